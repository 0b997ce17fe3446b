"""A port for robot programs: plain TCP, off by default, bound to one session, with the rights and log of REST."""

import asyncio
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from ipaddress import ip_address, ip_network
from typing import Annotated, Any

from pydantic import AfterValidator, Field
from starlette.concurrency import run_in_threadpool

from calib_core.errors import CalibrationError, ConflictError, InputError
from calib_core.messages import message
from calib_core.moment import now
from calib_core.records import Record
from server.auth.logins import Identity, Logins
from server.auth.refusals import Refusals
from server.auth.roles import Role
from server.hosts import HostName
from server.live.dialogue import (
    LONGEST_MESSAGE,
    Answer,
    Message,
    next_message,
    parse_message,
    plain,
    pose_of,
    refusal,
)
from server.live.live_captures import Shot
from server.live.manager import LiveCells, require_live
from server.sources.device import host_now_s
from server.store.audit import Act, acting
from server.store.captures import capture_ids
from server.store.database import Store
from server.store.models import CaptureRow
from server.store.sessions import session_row

_MOST_PEERS = 4
_FIRST_LINE_S, _NEXT_LINE_S = 10.0, 3600.0
_KEPT_LINES = 40


def _network(text: str) -> str:
    ip_network(text, strict=False)  # raises ValueError
    return text


class RobotPortSettings(Record):
    """Where robot programs are listened for, and from which addresses or networks they may come."""

    host: HostName = Field(default="127.0.0.1", max_length=64)
    port: int = Field(default=0, ge=0, le=65535, description="0: any that is free.")
    allowed: list[Annotated[str, AfterValidator(_network)]] = Field(
        default=["127.0.0.1"], min_length=1, max_length=20, description="Addresses, or networks as 192.168.0.0/24."
    )


@dataclass
class OpenPort:
    """A port that listens for one session."""

    session_id: str
    settings: RobotPortSettings
    server: asyncio.Server
    peers: set[str] = field(default_factory=set[str])
    lines: deque[dict[str, Any]] = field(default_factory=lambda: deque[dict[str, Any]](maxlen=_KEPT_LINES))
    tasks: set["asyncio.Task[None]"] = field(default_factory=lambda: set["asyncio.Task[None]"]())

    def told(self) -> dict[str, Any]:
        """Return the port as REST shows it."""
        host, port = self.server.sockets[0].getsockname()[:2]
        return {
            "open": True,
            "host": host,
            "port": port,
            "allowed": self.settings.allowed,
            "peers": sorted(self.peers),
            "lines": list(self.lines),
        }

    def note(self, peer: str, heard: str, said: str) -> None:
        """Keep a line of the dialogue for the page; tokens never come here."""
        self.lines.append({"at": now(), "peer": peer, "heard": heard[:200], "said": said})


class RobotPorts:
    """The ports that are open, at most one a session; none is after a restart."""

    def __init__(self, store: Store, cells: LiveCells, logins: Logins, refusals: Refusals) -> None:
        self._store, self._cells, self._logins, self._refusals = store, cells, logins, refusals
        self._open: dict[str, OpenPort] = {}

    def told(self, session_id: str) -> dict[str, Any]:
        """Return a session's port."""
        port = self._open.get(session_id)
        closed = {"open": False, "host": None, "port": None, "allowed": [], "peers": [], "lines": []}
        return port.told() if port else closed

    async def open(self, session_id: str, settings: RobotPortSettings) -> None:
        """Listen for a session's robot, in place of the port that it had.

        Raises
        ------
        InputError
            If the address cannot be listened on.
        """
        await self.close(session_id)

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            task = asyncio.current_task()
            assert task is not None
            port.tasks.add(task)
            try:
                await self._serve(port, reader, writer)
            except (OSError, TimeoutError, asyncio.CancelledError):
                pass  # the robot has gone, or the port closes
            finally:
                port.tasks.discard(task)
                writer.close()

        try:
            server = await asyncio.start_server(serve, settings.host, settings.port, limit=4 * LONGEST_MESSAGE)
        except OSError as error:
            got = message("none to be had ({strerror})", strerror=error.strerror or error)
            raise InputError("an address to serve on", got, "Choose another port or host.", "port") from None
        port = self._open[session_id] = OpenPort(session_id, settings, server)

    async def close(self, session_id: str) -> None:
        """Stop listening for a session; robots that are connected are cut off."""
        port = self._open.pop(session_id, None)
        if port is None:
            return
        port.server.close()
        for task in list(port.tasks):
            task.cancel()
        with suppress(TimeoutError):
            await asyncio.wait_for(port.server.wait_closed(), 2.0)

    async def close_all(self) -> None:
        """Close every port: the server stops."""
        for session_id in list(self._open):
            await self.close(session_id)

    async def answer(self, session_id: str, text: str, act: Act) -> tuple[Answer, bool]:
        """Do what a message asks; return the answer, and whether it is to be written as XML."""
        message = None
        try:
            message = parse_message(text)
            return await self._do(session_id, message, act), message.xml
        except CalibrationError as error:
            capture = message.capture if message and message.action == "capture" else ""
            return refusal(error, capture), message.xml if message else text.lstrip().startswith("<")

    async def _do(self, session_id: str, message: Message, act: Act) -> Answer:
        if message.action == "token":
            raise InputError("a token in the first line alone", "something else", "Send captures now.")
        if message.action == "done":
            count = len(await run_in_threadpool(self._ids, session_id))
            return Answer(True, f"done {count} captures")
        known, shot = await run_in_threadpool(self._shot, session_id, message, act)
        if known is not None:
            return known
        require_live(self._cells, session_id).ask(shot)
        taken = await asyncio.wrap_future(shot.answer)
        words = {"pass": "good", "warn": "weak"}.get(taken.verdict)
        if words is None:
            return Answer(False, plain(f"stored but {taken.text}"), taken.capture)
        return Answer(True, words, taken.capture, taken.zone)

    def _ids(self, session_id: str) -> set[str]:
        with self._store.read() as db:
            session_row(db, session_id)
            return capture_ids(db, session_id)

    def _shot(self, session_id: str, message: Message, act: Act) -> tuple[Answer | None, Shot]:
        """Return the answer where the capture is stored already, its first one having got lost; and the shot."""
        with self._store.read() as db:
            convention = session_row(db, session_id).record["cell"]["pose_convention"]
            stored = db.get(CaptureRow, (session_id, message.capture))
        told = pose_of(message, convention)
        numbers, pose = told or (None, None)
        shot = Shot(
            message.capture,
            host_now_s(),
            numbers,
            pose,
            dict(message.fields),
            f"robot program at {act.address}",
            act,
        )
        if stored is None:
            return None, shot
        if numbers is not None and stored.record.get("pose") == numbers:
            zone = stored.measured.get("zone")
            return Answer(
                True, "good" if stored.measured["verdict"] == "pass" else "weak", message.capture, zone
            ), shot
        to_do = "Use another name."
        raise ConflictError("a new capture", "{capture} is stored already", to_do, capture=message.capture)

    async def _serve(self, port: OpenPort, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        address = str(writer.get_extra_info("peername")[0])
        received = _Received(reader)
        act = Act("nobody", "nobody", None, address, "TCP", f"/api/v1/sessions/{port.session_id}/robot")
        if not _is_allowed(address, port.settings.allowed) or len(port.peers) >= _MOST_PEERS:
            await run_in_threadpool(self._refusals.note, self._store, act)
            return
        first = await received.message(_FIRST_LINE_S)
        identity, answer = await self._identified(first, act)
        xml = first is not None and first.lstrip().startswith("<")
        port.note(address, "(token)", answer.line())
        await _say(writer, answer, xml)
        if identity is None:
            return
        act.who, act.role, act.token_id = identity.name, identity.role.word, identity.token_id
        peer = f"{address} ({identity.name})"
        port.peers.add(peer)
        try:
            while (text := await received.message(_NEXT_LINE_S)) is not None:
                if not await run_in_threadpool(self._is_good, identity, first):
                    break  # the token was revoked meanwhile
                fresh = Act(act.who, act.role, act.token_id, address, act.method, act.path)
                answer, xml = await self.answer(port.session_id, text, fresh)
                port.note(peer, plain(text), answer.line())
                await _say(writer, answer, xml)
        except InputError as error:
            await _say(writer, refusal(error))
        finally:
            port.peers.discard(peer)

    async def _identified(self, first: str | None, act: Act) -> tuple[Identity | None, Answer]:
        """Return who a first line's token is of, None where he may not take captures; and the answer."""
        try:
            message = parse_message(first or "")
        except InputError:
            message = Message("done")
        identity = None
        if message.action == "token":
            identity = await run_in_threadpool(self._logins.by_token, message.capture)
        if identity is not None and identity.role >= Role.CAPTURE:
            return identity, Answer(True, plain(f"hello {identity.name}"))
        try:
            self._refusals.wrong_secret(act.address)
        except CalibrationError as error:
            return None, refusal(error)
        await run_in_threadpool(self._refusals.note, self._store, act)
        return None, Answer(False, "no good token in the first line, ask for one with the role capture")

    def _is_good(self, identity: Identity, first: str | None) -> bool:
        return self._logins.by_token(parse_message(first or "").capture) == identity


class _Received:
    """What a robot has sent, message by message."""

    def __init__(self, reader: asyncio.StreamReader) -> None:
        self._reader, self._rest = reader, b""

    async def message(self, wait_s: float) -> str | None:
        """Return the next message, None at the end; raises TimeoutError, OSError, InputError."""
        while (found := next_message(self._rest)) is None:
            more = await asyncio.wait_for(self._reader.read(LONGEST_MESSAGE), wait_s)
            if not more:
                return None
            self._rest += more
        text, self._rest = found
        return text


async def _say(writer: asyncio.StreamWriter, answer: Answer, xml: bool = False) -> None:
    writer.write(answer.to_bytes(xml))
    await writer.drain()


def _is_allowed(address: str, allowed: list[str]) -> bool:
    own = ip_address(address)
    own = getattr(own, "ipv4_mapped", None) or own
    return any(own in ip_network(text, strict=False) for text in allowed)


def acting_now(address: str) -> Act:
    """Return who acts in a request of REST."""
    return acting.get() or Act("this machine", "admin", None, address, "POST", "robot")
