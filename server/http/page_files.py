"""The page's files as browsers may keep them: below an address that changes with any of them, for good.

There is no build step: the page is some ninety modules, and a second visit would wait for the answers whether each
of them has changed.
"""

from hashlib import sha256
from pathlib import Path

from starlette.responses import HTMLResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

_MARK = "~"
_FOR_GOOD = "public, max-age=31536000, immutable"


class PageFiles(StaticFiles):
    """The files of a folder, each by its plain name, and by its name below `~` and the mark of their state.

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(directory=folder, check_dir=False)
        self._folder = folder
        self._mark = ""

    def document(self, name: str) -> Response:
        """Return an HTML file that names the others by the mark of their present state."""
        self._mark = _mark_of(self._folder)
        text = (self._folder / name).read_text(encoding="utf-8").replace('"/web/', f'"/web/{self._mark}/')
        return HTMLResponse(text, headers={"Cache-Control": "no-cache"})

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Answer a file; one that was asked for by the present mark never changes."""
        mark, _, name = path.partition("/")
        if not mark.startswith(_MARK):
            return await super().get_response(path, scope)
        response = await super().get_response(name, scope)
        if mark == self._mark and response.status_code in (200, 304):
            response.headers["Cache-Control"] = _FOR_GOOD
        return response


def _mark_of(folder: Path) -> str:
    """Return what changes with every file that is added, removed or written."""
    states = ((file, file.stat()) for file in sorted(folder.rglob("*")) if file.is_file())
    told = "\n".join(f"{file.relative_to(folder)} {state.st_size} {state.st_mtime_ns}" for file, state in states)
    return _MARK + sha256(told.encode()).hexdigest()[:16]
