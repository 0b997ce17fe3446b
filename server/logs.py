"""The server's log on standard error: JSON for machines, plain lines for whoever looks at a terminal."""

import json
import logging
import sys
from datetime import UTC, datetime
from typing import Literal

from server.http.access_log import request_id

Form = Literal["json", "text", "auto"]


def set_up(form: Form) -> None:
    """Write everything from here on that the server has to say; `auto` is text on a terminal, else JSON."""
    if form == "auto":
        form = "text" if sys.stderr.isatty() else "json"
    handler = logging.StreamHandler()
    handler.setFormatter(JsonLines() if form == "json" else logging.Formatter("%(levelname)s %(message)s"))
    logging.basicConfig(level=logging.WARNING, handlers=[handler], force=True)
    if form == "json":
        logging.getLogger("scancell").setLevel(logging.INFO)


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
        return json.dumps(line, ensure_ascii=False, default=str)
