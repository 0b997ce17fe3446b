"""What an imported archive held beside session and results, as it came."""

from pathlib import PurePosixPath
from typing import Annotated, Final
from urllib.parse import quote

from fastapi import APIRouter, Path, Response

from calib_core.archive.archive import REPORT_FILE, SCENE_FILE
from calib_core.errors import NotFoundError
from server.http.dependencies import SessionId, StoreDep
from server.http.downloads import Download
from server.http.schemas import KeptFile, KeptFiles
from server.http.strict_json import StrictRoute
from server.store.archived_files import archived_files
from server.store.sessions import session_row

router = APIRouter(prefix="/sessions/{session_id}/kept", tags=["archives"], route_class=StrictRoute)

_PAGES: Final = (REPORT_FILE, SCENE_FILE)
# An archive comes from anywhere: its pages run in a world of their own, without this server's login or addresses.
_POLICY: Final = (
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval' blob: data:; "
    "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; worker-src blob:; connect-src data: blob:"
)


@router.get("", response_model=KeptFiles)
def list_kept(session_id: SessionId, store: StoreDep) -> KeptFiles:
    """List what the archive held that this session was imported from: its scene, report, truth, notes."""
    with store.read() as db:
        session_row(db, session_id)
        kept = archived_files(db, session_id)
    return KeptFiles(items=[KeptFile(name=name, bytes=f.size, sha256=f.sha256) for name, f in kept.items()])


@router.get(
    "/{name:path}",
    response_class=Response,
    responses={200: {"description": "The file.", "content": {"application/octet-stream": {}, "text/html": {}}}},
)
def get_kept(
    session_id: SessionId,
    name: Annotated[
        str,
        Path(description="As in the list: `scene.html`, `truth.json`.", max_length=1000, examples=["truth.json"]),
    ],
    store: StoreDep,
) -> Download:
    """Return a file of the archive byte for byte; `scene.html` and `report.html` as pages on their own."""
    with store.read() as db:
        session_row(db, session_id)
        kept = archived_files(db, session_id)
    if name not in kept:
        there = ", ".join(sorted(kept)) or "it kept none"
        raise NotFoundError(
            f"a file that the session's archive held ({there})", repr(name[:80]), "List them first.", session_id
        )
    page = name in _PAGES
    file = store.blobs.open(kept[name].sha256)
    how = "inline" if page else "attachment"
    return Download(
        file,
        "text/html; charset=utf-8" if page else "application/octet-stream",
        {
            "Content-Length": str(kept[name].size),
            "ETag": f'"{kept[name].sha256}"',
            "Content-Disposition": f"{how}; filename*=UTF-8''{quote(PurePosixPath(name).name)}",
            "Content-Security-Policy": _POLICY if page else "sandbox; default-src 'none'",
        },
    )
