"""What an imported archive held beside session and results, as it came."""

from html import escape
from pathlib import PurePosixPath
from typing import Annotated, Final
from urllib.parse import quote

from fastapi import Path, Query, Response
from fastapi.responses import HTMLResponse

from calib_core.archive.archive import REPORT_FILE
from calib_core.errors import InputError, NotFoundError
from server.http.api_router import API, api_router
from server.http.downloads import Download
from server.http.schemas import KeptFile, KeptFiles
from server.routes.dependencies import SessionId, StoreDep
from server.store.archived_files import archived_files
from server.store.sessions import session_row

router = api_router("archives", f"{API}/sessions/{{session_id}}/kept")

# An archive comes from anywhere. What is shown of it runs no script and has neither this server's login nor its
# addresses; and since a page may follow its own links whatever its policy says, it is shown within a page of ours,
# whose policy lets no frame in it go anywhere (`frame-src`, which what stands in `srcdoc` needs not).
_SHOWN: Final = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; base-uri 'none'; "
    "form-action 'none'; frame-src 'none'; frame-ancestors 'self'"
)
_AS_FILE: Final = "sandbox; default-src 'none'"
_MOST_SHOWN_BYTES: Final = 20_000_000
_PAGE: Final = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{name}</title>
<style>
html, body {{ height: 100%; margin: 0 }}
iframe {{ display: block; width: 100%; height: 100%; border: 0; background: #fff }}
</style>
</head><body><iframe sandbox title="{name}" srcdoc="{page}"></iframe></body></html>
"""


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
    show: Annotated[
        bool, Query(description="Of `report.html`: as a page that neither runs nor leads away.")
    ] = False,
) -> Response:
    """Return a file of the archive byte for byte, to be saved; with `show` the report as a page to look at."""
    with store.read() as db:
        session_row(db, session_id)
        kept = archived_files(db, session_id)
    if name not in kept:
        there = ", ".join(sorted(kept)) or "none"
        need = "a file that the session's archive held ({there})"
        raise NotFoundError(need, repr(name[:80]), "List them first.", session_id, there=there)
    file = store.blobs.open(kept[name].sha256)
    if show:
        if name != REPORT_FILE or kept[name].size > _MOST_SHOWN_BYTES:
            file.close()
            to_do = "Leave `show` out and save it."
            raise InputError("{report_file} to be shown", repr(name[:80]), to_do, "show", report_file=REPORT_FILE)
        with file:
            page = file.read().decode("utf-8", errors="replace")
        shown = _PAGE.format(name=REPORT_FILE, page=escape(page))
        return HTMLResponse(shown, headers={"Content-Security-Policy": _SHOWN})
    return Download(
        file,
        "application/octet-stream",
        {
            "Content-Length": str(kept[name].size),
            "ETag": f'"{kept[name].sha256}"',
            "Content-Disposition": f"attachment; filename*=UTF-8''{quote(PurePosixPath(name).name)}",
            "Content-Security-Policy": _AS_FILE,
        },
    )
