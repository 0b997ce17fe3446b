"""The page's files as browsers may keep them: below an address that changes with any of them, for good.

There is no build step: the page is some ninety modules, and a second visit would wait for the answers whether each
of them has changed. A quarter of them is comments and types, which browsers do without: what they keep has empty
lines there, so that a complaint still names the line of the source.
"""

import re
from collections.abc import Callable
from datetime import datetime
from hashlib import sha256
from pathlib import Path, PurePosixPath

from starlette.responses import FileResponse, HTMLResponse, JSONResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from calib_core import __version__
from calib_core.findings.catalogues import LANGUAGES
from server.http.page_texts import served

_MARK = "~"
_FOR_GOOD = "public, max-age=31536000, immutable"
_COMMENTS = re.compile(r"^[ \t]*(?:/\*(?:[^*]|\*(?!/))*\*/[ \t]*|//[^\n]*)$", re.MULTILINE)
"""Comments that have lines for themselves; no string of the page goes over lines and looks like one."""
_TYPES = re.compile(r"/\*\* @(?:[^*]|\*(?!/))*\*/ ?")
"""What the code says of its types within a line."""
_INDENT = re.compile(r"^[ \t]+", re.MULTILINE)
_SCRIPTS = (".js", ".css")
_TEXTS = {
    f"texts/{place}{language}.json": (language, place != "") for language in LANGUAGES for place in ("", "later/")
}
_MEDIA_TYPES = {
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".json": "application/json",
    ".svg": "image/svg+xml",
}
"""Told here: Windows' registry may call a script text/plain, which no browser runs."""


class PageFiles(StaticFiles):
    """The files of a folder, each by its plain name, and by its name below `~` and the mark of their state.

    Parameters
    ----------
    folder : Path
    updated : callable
        Returns when the data folder was updated to this version, None where it never was.
    """

    def __init__(self, folder: Path, updated: Callable[[], datetime | None] = lambda: None) -> None:
        super().__init__(directory=folder, check_dir=False)
        self._folder, self._updated = folder, updated
        self._mark = ""

    def document(self, name: str) -> Response:
        """Return an HTML file that names others by the mark of their state, and what runs on which data."""
        self._mark = _mark_of(self._folder)
        text = (self._folder / name).read_text(encoding="utf-8").replace('"/web/', f'"/web/{self._mark}/')
        updated = self._updated()
        told = {"version": __version__, "data-updated": "" if updated is None else updated.isoformat()}
        metas = "".join(f'\n  <meta name="{name}" content="{content}">' for name, content in told.items())
        text = text.replace("</title>", f"</title>{metas}", 1)
        return HTMLResponse(text, headers={"Cache-Control": "no-cache"})

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Answer a file; one that was asked for by the present mark never changes."""
        path = path.replace("\\", "/")  # on Windows it comes as a path of that system
        mark, _, name = path.partition("/")
        if not mark.startswith(_MARK):
            return await self._plain(path, scope)
        response = await self._plain(name, scope)
        if mark != self._mark or response.status_code not in (200, 304):
            return response
        if isinstance(response, FileResponse) and name.endswith(_SCRIPTS) and not name.startswith("vendor/"):
            text = Path(response.path).read_text(encoding="utf-8")
            response = Response(without_comments(text), headers={"Content-Type": response.headers["content-type"]})
        response.headers["Cache-Control"] = _FOR_GOOD
        return response

    async def _plain(self, name: str, scope: Scope) -> Response:
        if name in _TEXTS:
            return JSONResponse(served(self._folder / "texts", *_TEXTS[name]))
        response = await super().get_response(name, scope)
        if isinstance(response, FileResponse) and (kind := _MEDIA_TYPES.get(PurePosixPath(name).suffix.lower())):
            response.headers["Content-Type"] = kind
        return response


def without_comments(text: str) -> str:
    """Return a script or a style sheet without its comments and indentation, its lines where they were."""

    def lines(comment: re.Match[str]) -> str:
        return "\n" * comment[0].count("\n")

    return _INDENT.sub("", _TYPES.sub(lines, _COMMENTS.sub(lines, text)))


def _mark_of(folder: Path) -> str:
    """Return what changes with every file that is added, removed or written."""
    states = ((file, file.stat()) for file in sorted(folder.rglob("*")) if file.is_file())
    told = "\n".join(f"{file.relative_to(folder)} {state.st_size} {state.st_mtime_ns}" for file, state in states)
    return _MARK + sha256(told.encode()).hexdigest()[:16]
