"""Machines that send captures at a steady rate, as light as they can be: they share the cores with the server."""

import asyncio
import json
import random
import sys
import time
from dataclasses import asdict, dataclass, field
from typing import Any

from calib_core.simulation import SimulatedSession, simulate

BOUNDARY = "scancell-load"
_DISTINCT = 14  # profiles of one simulated cell, each made unique by a comment


@dataclass
class Sent:
    """What became of the requests of one client or of all: durations in seconds, and what went wrong."""

    durations_s: list[float] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    late_s: float = 0.0
    processor_s: float = 0.0


class Connection:
    """One kept connection that speaks as much HTTP/1.1 as the server's answers need."""

    def __init__(self, host: str, port: int) -> None:
        self._host, self._port = host, port
        self._streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None

    async def post(self, path: str, content_type: str, body: bytes) -> tuple[int, bytes]:
        """Send a request and return status and body of its answer."""
        if self._streams is None:
            self._streams = await asyncio.open_connection(self._host, self._port, limit=1 << 24)
        reader, writer = self._streams
        head = (
            f"POST {path} HTTP/1.1\r\nHost: {self._host}:{self._port}\r\nContent-Type: {content_type}\r\n"
            f"Content-Length: {len(body)}\r\n\r\n"
        )
        writer.write(head.encode() + body)
        await writer.drain()
        status_line, *lines = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").split("\r\n")
        headers = {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
        return int(status_line.split()[1]), await reader.readexactly(int(headers["content-length"]))

    def close(self) -> None:
        """Hang up."""
        if self._streams is not None:
            self._streams[1].close()


def capture_form(record: dict[str, object], content: bytes) -> bytes:
    """Return the multipart body of one capture with one file."""
    text = (
        f'--{BOUNDARY}\r\nContent-Disposition: form-data; name="record"\r\n\r\n{json.dumps(record)}\r\n'
        f'--{BOUNDARY}\r\nContent-Disposition: form-data; name="files"; filename="p.csv"\r\n'
        "Content-Type: text/csv\r\n\r\n"
    )
    return text.encode() + content + f"\r\n--{BOUNDARY}--\r\n".encode()


@dataclass
class Load:
    """What all clients share."""

    host: str
    port: int
    per_s: float = 1.0
    seconds: float = 0.0
    cell: SimulatedSession = field(default_factory=lambda: simulate("tcp", 1))
    sent: Sent = field(default_factory=Sent)


async def client(load: Load, number: int, session: str) -> None:
    """Send captures of the simulated cell into a session, one at each tick."""
    connection = Connection(load.host, load.port)
    captures = load.cell.session.captures[:_DISTINCT]
    start_s = time.perf_counter() + random.Random(number).random() / load.per_s
    for tick in range(int(load.seconds * load.per_s)):
        due_s = start_s + tick / load.per_s
        await asyncio.sleep(max(0.0, due_s - time.perf_counter()))
        load.sent.late_s = max(load.sent.late_s, time.perf_counter() - due_s)
        capture = captures[tick % len(captures)]
        record = {**capture.to_json(), "id": f"c{tick:05d}", "files": [f"captures/c{tick:05d}.csv"]}
        content = b"# client %d, capture %d\n" % (number, tick) + load.cell.files[capture.files[0]]
        path = f"/api/v1/sessions/{session}/captures"
        began_s = time.perf_counter()
        try:
            status, body = await connection.post(
                path, f"multipart/form-data; boundary={BOUNDARY}", capture_form(record, content)
            )
        except (OSError, asyncio.IncompleteReadError) as error:
            load.sent.errors.append(f"{type(error).__name__}: {error}")
            connection = Connection(load.host, load.port)
            continue
        load.sent.durations_s.append(time.perf_counter() - began_s)
        if status != 201:
            load.sent.errors.append(f"{status}: {body[:200].decode(errors='replace')}")
    connection.close()


async def send(sessions: list[str], **arguments: Any) -> Sent:
    """Let a client for each session send, all at once."""
    load = Load(**arguments)
    before_s = time.process_time()
    await asyncio.gather(*(client(load, number, session) for number, session in enumerate(sessions)))
    load.sent.processor_s = time.process_time() - before_s
    return load.sent


def batch_body(load: Load, session: str, captures: int) -> bytes:
    """Return captures of the simulated cell as the batch route takes them."""
    body: list[bytes] = []
    for number in range(captures):
        capture = load.cell.session.captures[number % _DISTINCT]
        content = b"# %s, capture %d\n" % (session.encode(), number) + load.cell.files[capture.files[0]]
        record = {**capture.to_json(), "id": f"b{number:06d}", "files": [f"captures/b{number:06d}.csv"]}
        body += [json.dumps({**record, "sizes": [len(content)]}).encode(), b"\n", content]
    return b"".join(body)


async def send_batch(session: str, captures: int, **arguments: Any) -> Sent:
    """Send many captures in one request."""
    load = Load(**arguments)
    body = batch_body(load, session, captures)
    connection = Connection(load.host, load.port)
    began_s = time.perf_counter()
    status, answer = await connection.post(
        f"/api/v1/sessions/{session}/captures/batch", "application/octet-stream", body
    )
    load.sent.durations_s.append(time.perf_counter() - began_s)
    connection.close()
    items = json.loads(answer).get("items", [])
    if status != 200 or [item["status"] for item in items] != [201] * captures:
        load.sent.errors.append(f"{status}: {answer[:200].decode(errors='replace')}")
    return load.sent


if __name__ == "__main__":
    arguments = json.loads(sys.argv[1])
    act = send_batch if "session" in arguments else send
    print(json.dumps(asdict(asyncio.run(act(**arguments)))))
