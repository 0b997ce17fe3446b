"""The server's log on standard error: JSON for machines, plain lines for whoever looks at a terminal."""

import atexit
import json
import logging
import sys
import threading
import time
from contextlib import suppress
from datetime import UTC, datetime
from queue import SimpleQueue
from typing import Literal, TextIO

from server.http.access_log import request_id

_MOST_LINES = 10_000
_LAST_LINES_S = 1.0

_JSON = json.JSONEncoder(ensure_ascii=False, default=str)

Form = Literal["json", "text", "auto"]


def set_up(form: Form) -> None:
    """Write everything from here on that the server has to say; `auto` is text on a terminal, else JSON."""
    if form == "auto":
        form = "text" if sys.stderr.isatty() else "json"
    handler = BackgroundHandler(sys.stderr)
    handler.setFormatter(JsonLines() if form == "json" else logging.Formatter("%(levelname)s %(message)s"))
    logging.basicConfig(level=logging.WARNING, handlers=[handler], force=True)
    if form == "json":
        logging.getLogger("scancell").setLevel(logging.INFO)


class BackgroundHandler(logging.Handler):
    """Writes in a thread of its own: a reader of the log that hangs does not hold up what the server does.

    What cannot be kept until then is left out, and how many lines that were is said afterwards.
    """

    def __init__(self, stream: TextIO) -> None:
        super().__init__()
        self._stream = stream
        self._lines: SimpleQueue[str] = SimpleQueue()
        self._lost = 0
        threading.Thread(target=self._write, name="log", daemon=True).start()
        atexit.register(self._finish)

    def emit(self, record: logging.LogRecord) -> None:
        """Leave a line to be written."""
        if self._lines.qsize() >= _MOST_LINES:
            self._lost += 1
            return
        try:
            self._lines.put(self.format(record))
        except Exception:
            self.handleError(record)

    def _write(self) -> None:
        while True:
            line = self._lines.get()
            with suppress(OSError, ValueError):  # nobody reads it any more
                self._stream.write(f"{line}\n")
                self._stream.flush()
            if self._lost and self._lines.empty():
                lost, self._lost = self._lost, 0
                logging.getLogger("scancell").warning("%d lines of this log could not be written in time", lost)

    def _finish(self) -> None:
        end_s = time.monotonic() + _LAST_LINES_S
        while not self._lines.empty() and time.monotonic() < end_s:
            time.sleep(0.01)


class JsonLines(logging.Formatter):
    """One line of JSON for each thing said."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line: time, level, what is said, the request it belongs to, its facts, an error's traces."""
        line: dict[str, object] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        number = request_id.get()
        if number is not None:
            line["request"] = number
        line |= getattr(record, "facts", {})
        if record.exc_info:
            line["error"] = self.formatException(record.exc_info)
        return _JSON.encode(line)
