"""What live cells remember of each session in a small JSON file of the data folder, also across a restart."""

import json
import threading
from pathlib import Path
from typing import Any

from calib_core.disk import replace_file
from server.store.models import Data


class KeptBySession:
    """JSON data by session; each change replaces the file as a whole."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()

    def get(self, session_id: str) -> Data:
        """Return what is kept of a session, empty where nothing is."""
        return self._all().get(session_id, {})

    def put(self, session_id: str, data: Data) -> None:
        """Keep this of a session in place of what was kept."""
        with self._lock:
            fresh = self._path.with_suffix(".new")
            fresh.write_text(json.dumps({**self._all(), session_id: data}), encoding="utf-8")
            replace_file(fresh, self._path)

    def _all(self) -> dict[str, Any]:
        return json.loads(self._path.read_text(encoding="utf-8")) if self._path.exists() else {}
