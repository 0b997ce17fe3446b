"""Clouds and meshes that a merge made: listed, and streamed in the formats of other programs."""

from pathlib import PurePosixPath
from typing import Annotated

from fastapi import Path, Query, Response
from fastapi.responses import StreamingResponse

from calib_core.errors import NotFoundError
from calib_core.messages import message
from calib_core.stages.merge.record import MergeResult
from server.http.api_router import api_router
from server.http.downloads import Download
from server.http.schemas import StoredCloudFile, StoredCloudFiles
from server.routes.dependencies import LoadedSession, SessionId, StoreDep
from server.store.session_answer import stage_headers
from server.store.sessions import StoredSession, load_session

router = api_router("clouds")

CloudName = Annotated[
    str,
    Path(
        description="`merged.ply`, or with another format's ending: `merged.e57`, `mesh.stl`.",
        max_length=80,
        examples=["merged.ply"],
    ),
]
CloudFormat = Annotated[
    str | None,
    Query(alias="format", description="One of the file's `formats`, whatever the name ends in.", max_length=8),
]


@router.get("/sessions/{session_id}/clouds", response_model=StoredCloudFiles)
def list_clouds(stored: LoadedSession, response: Response) -> StoredCloudFiles:
    """Return the clouds and meshes that there are, with the formats that each is given in."""
    from calib_core.archive.stored_clouds import MESH_FILE, REFERENCE_FILE, cloud_formats, mesh_formats

    response.headers.update(stage_headers(stored, "merge"))
    items = [
        StoredCloudFile(
            name=PurePosixPath(name).name,
            bytes=output.size,
            sha256=output.sha256,
            formats=mesh_formats() if name in (MESH_FILE, REFERENCE_FILE) else cloud_formats(),
        )
        for name, output in sorted(stored.outputs.items())
    ]
    return StoredCloudFiles(items=items)


@router.get(
    "/sessions/{session_id}/clouds/{name}",
    response_class=Response,
    responses={200: {"description": "The file, in its own media type.", "content": {"model/ply": {}}}},
)
def get_cloud(
    session_id: SessionId, name: CloudName, store: StoreDep, wanted: CloudFormat = None
) -> StreamingResponse:
    """Return the merged cloud or its mesh; as PLY it is what the merge stored, byte for byte."""
    from calib_core.archive.stored_clouds import StoredFile, in_format, media_types, requested

    file, chosen = requested(name, wanted)
    with store.read() as db:
        stored = load_session(db, store.blobs, session_id)
    output = stored.outputs.get(file)
    if output is None:
        raise _missing(stored, name)
    headers = {
        "ETag": f'"{output.sha256}-{chosen}"',
        "Content-Disposition": f'attachment; filename="{PurePosixPath(file).stem}.{chosen}"',
        **stage_headers(stored, "merge"),
    }
    merge = stored.results.get("merge")
    scans = () if merge is None else MergeResult.model_validate(merge).scan_places
    content = store.blobs.open(output.sha256)
    if chosen == "ply":
        headers["Content-Length"] = str(output.size)
        return Download(content, media_types()[chosen], headers)
    try:
        pieces = in_format(StoredFile(content, file), chosen, file, scans)
    except BaseException:
        content.close()
        raise
    return Download(content, media_types()[chosen], headers, pieces)


def _missing(stored: StoredSession, name: str) -> NotFoundError:
    if stored.outputs:
        return NotFoundError.unknown(name, (PurePosixPath(one).name for one in sorted(stored.outputs)), "name")
    to_do = message("POST …/sessions/{stored}/solve/merge makes it.", stored=stored.id)
    return NotFoundError("a merged cloud", "none", to_do, "name")
