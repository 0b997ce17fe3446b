"""The example source of docs/examples: short, and good against a server of its kind, also when that goes away."""

import importlib.util
import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from server.live.link import Link
from server.sources.device import Reading, Sample
from server.sources.source import Source
from tests.server.live_rig import until

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "own_source.py"


class Controller(BaseHTTPRequestHandler):
    moment = 0.0

    def do_GET(self) -> None:
        Controller.moment += 0.05
        body = json.dumps({"pose": [1, 2, 3, 10, 20, 30], "moving": False, "t": Controller.moment}).encode()
        self.send_response(200)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: Any) -> None:
        return


def served(port: int = 0) -> ThreadingHTTPServer:
    server = ThreadingHTTPServer(("127.0.0.1", port), Controller)
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}).start()
    return server


def ended(server: ThreadingHTTPServer) -> None:
    server.shutdown()
    server.server_close()


def test_a_source_of_ones_own_is_one_short_file() -> None:
    assert len(EXAMPLE.read_text(encoding="utf-8").splitlines()) <= 60
    spec = importlib.util.spec_from_file_location("own_source", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    source = module.SOURCE
    assert isinstance(source, Source)
    assert source.describe()["settings"]["required"] == ["url"]
    taken: list[Reading] = []
    server = served()
    port = server.server_address[1]
    settings = source.settings(url=f"http://127.0.0.1:{port}/pose")
    link = Link("robot", source, settings, lambda _, reading: taken.append(reading), lambda _: None)
    link.start()
    try:
        until(lambda: len(taken) > 2)
        assert link.state().status == "live"
        ended(server)
        until(lambda: link.state().status == "lost")
        server = served(port)
        count = len(taken)
        until(lambda: len(taken) > count)
    finally:
        ended(server)
        link.stop()
    found = taken[0]
    assert isinstance(found, Sample)
    assert found.base_from_tool0 is not None
    assert found.base_from_tool0.translation_mm.tolist() == [1, 2, 3]
