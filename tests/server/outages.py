"""Parts that a server rests on, which go away and come back: databases, buckets, clusters, and the way to them."""

import signal
import socket
import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import httpx

from server.jobs.child_processes import WorkerContext
from tests.server.forked_commands import fork_from_one, run_quietly
from tests.server.postgres import lasting_port

HEALED_S = 30.0
_STARTED_S = 180.0


class Gate:
    """A way to another server that can be shut, as when that one is restarted, hang, or refuse with 503."""

    def __init__(self, target: str) -> None:
        self._host, _, port = target.rpartition(":")
        self._target = (self._host, int(port))
        self.port = lasting_port()
        self._process: subprocess.Popen[bytes] | None = None

    def open(self) -> None:
        """Let pass, whatever the way was before."""
        self._begin(_RELAY.format(port=self.port, target=self._target))

    def refuse(self) -> None:
        """Answer every request with 503, as a store does that has too much to do."""
        self._begin(_BUSY.format(port=self.port))

    def hang(self) -> None:
        """Take connections and bytes, and answer nothing."""
        assert self._process is not None
        self._process.send_signal(signal.SIGSTOP)

    def _begin(self, code: str) -> None:
        if self._process is not None:
            self.shut()
        self._process = subprocess.Popen([sys.executable, "-c", code])
        until_there(self.port)

    def shut(self) -> None:
        assert self._process is not None
        self._process.kill()
        self._process.wait()


_RELAY = """
import asyncio
async def relay(reader, writer):
    try:
        there, back = await asyncio.open_connection(*{target!r})
    except OSError:
        writer.close()
        return
    async def copy(a, b):
        try:
            while data := await a.read(65536):
                b.write(data)
                await b.drain()
        except OSError:
            pass
        b.close()
    await asyncio.gather(copy(reader, back), copy(there, writer))
async def main():
    await (await asyncio.start_server(relay, "127.0.0.1", {port})).serve_forever()
asyncio.run(main())
"""
_BUSY = """
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
class Busy(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    def refuse(self):
        said = b"<Error><Code>SlowDown</Code><Message>Reduce your request rate.</Message></Error>"
        said = b"" if self.command == "HEAD" else said
        self.send_response(503)
        self.send_header("Content-Length", str(len(said)))
        self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(said)
        self.close_connection = True
    do_GET = do_HEAD = do_PUT = do_POST = do_DELETE = refuse
    def log_message(self, *_):
        pass
ThreadingHTTPServer(("127.0.0.1", {port}), Busy).serve_forever()
"""


@contextmanager
def gated(target: str) -> Generator[Gate]:
    gate = Gate(target)
    gate.open()
    try:
        yield gate
    finally:
        gate.shut()


def until_health(client: httpx.Client, status: str, reason: str | None = None) -> dict[str, Any]:
    end_s = time.monotonic() + HEALED_S
    while (found := client.get("/health").json())["status"] != status or (
        reason is not None and reason not in found["reasons"]
    ):
        assert time.monotonic() < end_s, found
        time.sleep(0.1)
    return found


def start_scheduler(port: int) -> Any:
    """Start the scheduler of a Dask cluster."""
    return _start_dask("scheduler", "--port", str(port))


def start_worker(scheduler: str) -> Any:
    """Start a worker of a Dask cluster, with what a solve needs in memory."""
    return _start_dask("worker", scheduler, "--nthreads", "1", "--no-nanny")


def _start_dask(part: str, *words: str) -> Any:
    fork_from_one()
    arguments = (f"distributed.cli.dask_{part}", *words, "--host", "127.0.0.1", "--no-dashboard")
    process = WorkerContext(warm=True).Process(target=run_quietly, args=arguments)
    process.start()
    return process


def until_there(port: int, process: Any = None) -> None:
    """Wait until somebody listens; a process that shall may end with an error instead, or want for a processor."""
    end_s = time.monotonic() + _STARTED_S
    while True:
        try:
            socket.create_connection(("127.0.0.1", port), 1).close()
            return
        except OSError:
            assert process is None or process.is_alive(), f"what was to listen at {port} ended: {process.exitcode}"
            assert time.monotonic() < end_s, f"nobody listens at {port}"
            time.sleep(0.1)
