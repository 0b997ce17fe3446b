"""All live cells of the server: which devices are connected for which session, also across a restart."""

import asyncio
import json
import logging
import threading
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import SecretStr

from calib_core.disk import replace_file, temporary_folder
from calib_core.errors import CalibrationError, ConflictError, InputError
from calib_core.records import Capture, Measured
from calib_core.review.answer import cell_id
from server.background import BackgroundThread
from server.captures.intake import Intake
from server.live.clock_watch import MeasuredClocks
from server.live.link import Link, LinkState
from server.live.live_captures import CaptureSettings
from server.live.live_cell import LiveCell
from server.live.session_now import SessionNow
from server.scenes.display_options import RobotNow
from server.scenes.manager import SceneManager
from server.sources.registry import SOURCES
from server.sources.source import Source
from server.store.database import Store, record_event
from server.store.devices import DeviceSecrets, connected_devices, device_row, devices_of
from server.store.models import Data, DeviceRow
from server.store.sessions import empty_session, locked_session, session_row

_MOST_POINTS = 200

log = logging.getLogger("scancell")

_LOOK_EVERY_S = 0.1


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


class LiveCells(BackgroundThread):
    """Connects devices for sessions.

    Parameters
    ----------
    data : Path
        The data folder: what captures are taken for and devices' secrets are kept there.
    store : Store
    intake : Intake
    follow : callable, optional
        Is told ten times a second of each live cell: the scene shows where its robot stands.
    """

    def __init__(
        self,
        data: Path,
        store: Store,
        intake: Intake,
        follow: Callable[[str, LiveCell | None], object] | None = None,
    ) -> None:
        super().__init__("live cells", longest_s=10.0)
        self._store, self._intake, self._follow = store, intake, follow
        self._secrets = DeviceSecrets(data)
        self._data = data
        self._settings = KeptBySession(data / "live.json")
        self._clocks = KeptBySession(data / "live-clocks.json")
        self._cells: dict[str, LiveCell] = {}
        self._told: dict[tuple[str, str], str] = {}
        self._lock = threading.RLock()

    def start(self) -> None:
        """Connect what was connected when the server stopped."""
        with self._store.read() as db:
            rows = connected_devices(db)
        for row in rows:
            try:
                self._connect(row)
            except CalibrationError as error:  # an extra was removed, say
                log.warning("device %s of cell %s: %s", row.name, row.cell, error)
        super().start()

    def stop(self) -> None:
        """End all links."""
        super().stop()
        with self._lock:
            cells, self._cells = self._cells, {}
        for cell in cells.values():
            cell.stop()

    def live(self, session_id: str) -> LiveCell | None:
        """Return the live cell of a session, None where no device is connected."""
        return self._cells.get(session_id)

    def devices(self, session_id: str) -> list[tuple[DeviceRow, Source | None, list[str], LinkState | None]]:
        """Return a session's devices, each with its source, the names of its secrets, and its link's state."""
        with self._store.read() as db:
            rows = devices_of(db, self._cell(db, session_id))
        live = self._cells.get(session_id)
        links = live.links if live else {}
        sources = {source.name: source for source in SOURCES}
        return [
            (
                row,
                sources.get(row.source),
                sorted(self._secrets.get(row.cell, row.name)),
                links[row.name].state() if row.name in links and row.session_id == session_id else None,
            )
            for row in rows
        ]

    def put(self, session_id: str, name: str, source_name: str, settings: Data, connect: bool) -> None:
        """Keep a device with the session's cell, and connect it for this session or end its connection.

        A secret that is left out stays as it was.

        Raises
        ------
        InputError
            If there is no such live source, or its settings are of no use.
        """
        source = SOURCES.get(source_name, "source")
        if source.connect is None:
            raise InputError.unknown(source_name, (one.name for one in SOURCES if one.connect), "source")
        with self._lock:
            with self._store.write() as db:
                session = locked_session(db, session_id)
                cell = cell_id(empty_session(session.record, session_id))
                known = db.get(DeviceRow, (cell, name))
                old = self._secrets.get(cell, name) if known and known.source == source_name else {}
                secrets = {field: value for field, value in old.items() if field not in settings}
                chosen = source.settings.parsed({**settings, **secrets})
                plain, secrets = _split(source, chosen)
                bound = session_id if connect else None
                row = DeviceRow(cell=cell, name=name, source=source_name, settings=plain, session_id=bound)
                before = known.session_id if known else None
                db.merge(row)
                record_event(db, session, "device", {"device": name, "action": "configured"})
            self._secrets.put(cell, name, secrets)
            self._disconnect(before, name)
            if connect:
                self._connect(row)

    def remove(self, session_id: str, name: str) -> None:
        """Forget a device with its settings and secrets; raises NotFoundError."""
        with self._lock:
            with self._store.write() as db:
                session = locked_session(db, session_id)
                row = device_row(db, cell_id(empty_session(session.record, session_id)), name)
                bound, cell = row.session_id, row.cell
                db.delete(row)
                record_event(db, session, "device", {"device": name, "action": "removed"})
            self._secrets.put(cell, name, {})
            self._disconnect(bound, name)

    def capture_settings(self, session_id: str) -> CaptureSettings:
        """Return what the session's live captures are taken for."""
        return CaptureSettings.model_validate(self._settings.get(session_id))

    def set_capture(self, session_id: str, settings: CaptureSettings) -> None:
        """Change what live captures are taken for, also after a restart."""
        with self._lock:
            self._settings.put(session_id, settings.to_json())
            live = self._cells.get(session_id)
            if live is not None:
                live.settings = settings

    @contextmanager
    def recording_folder(self) -> Generator[Path]:
        """Give a folder for a recording's files, which is removed afterwards."""
        with temporary_folder("recording-", self._data) as folder:
            yield folder

    def _connect(self, row: DeviceRow) -> None:
        source = SOURCES.get(row.source, row.name)
        assert row.session_id is not None
        settings = source.settings.parsed({**row.settings, **self._secrets.get(row.cell, row.name)})
        with self._lock:
            live = self._cells.get(row.session_id)
            if live is None:
                live = self._cells[row.session_id] = self._new(row.session_id)
            live.add(Link(row.name, source, settings, live.arrived, live.forget))

    def _disconnect(self, session_id: str | None, name: str) -> None:
        live = self._cells.get(session_id or "")
        if live is None or session_id is None:
            return
        live.remove(name)
        self._told.pop((session_id, name), None)
        if not live.links:
            del self._cells[session_id]
            live.stop()
            self._show(session_id, None)

    def _new(self, session_id: str) -> LiveCell:
        known = SessionNow(self._store, session_id)

        def take(capture: Capture, contents: Mapping[str, bytes]) -> Measured:
            try:
                answer = asyncio.run(self._intake.take(session_id, capture, contents))
            finally:
                known.forget()
            return Measured.model_validate(json.loads(bytes(answer.body))["measured"])

        def leave_out(capture_id: str, why: str) -> None:
            self._intake.leave_out(session_id, capture_id, why)

        clocks = MeasuredClocks(self._clocks.get(session_id), lambda told: self._clocks.put(session_id, told))
        settings = self.capture_settings(session_id)
        return LiveCell(known, take, settings, clocks=clocks, leave_out=leave_out)

    def _cell(self, db: Any, session_id: str) -> str:
        return cell_id(empty_session(session_row(db, session_id).record, session_id))

    def _work(self) -> None:
        """Tell a session of each device that was lost or is back."""
        while not self._stopping.wait(_LOOK_EVERY_S):
            for session_id, live in list(self._cells.items()):
                self._show(session_id, live)
                for name, link in list(live.links.items()):
                    state = link.state()
                    key = session_id, name
                    if state.status == "connecting" or self._told.get(key) == state.status:
                        continue
                    self._told[key] = state.status
                    try:
                        self._tell(session_id, name, state)
                    except CalibrationError:
                        self._disconnect(session_id, name)  # the session was removed
                    except Exception:
                        log.exception("telling of device %s", name)

    def _show(self, session_id: str, live: LiveCell | None) -> None:
        if self._follow is None:
            return
        try:
            self._follow(session_id, live)
        except Exception:  # the scene is an extra
            log.exception("showing the robot of session %s", session_id)

    def _tell(self, session_id: str, name: str, state: LinkState) -> None:
        with self._store.write() as db:
            session = locked_session(db, session_id)
            told = {"device": name, "action": state.status, "problem": state.problem, "at": time.time()}
            record_event(db, session, "device", told)


def _split(source: Source, settings: Any) -> tuple[Data, Data]:
    """Return a device's settings without its secrets, and its secrets."""
    told = settings.model_dump(mode="json", exclude_unset=True)
    secrets = {
        name: value.get_secret_value()
        for name in source.settings.model_fields
        if isinstance(value := getattr(settings, name), SecretStr) and name in told
    }
    return {name: value for name, value in told.items() if name not in secrets}, secrets


def require_live(cells: LiveCells, session_id: str) -> LiveCell:
    """Return a session's live cell; raises ConflictError where no device is connected."""
    live = cells.live(session_id)
    if live is None:
        to_do = "Connect one in the session's devices."
        raise ConflictError("a device that is connected for this session", "none", to_do, "devices")
    return live


def follow_robot(scenes: SceneManager, session_id: str, live: LiveCell | None) -> None:
    """Show where a session's robot stands now, where anybody looks; None takes it away."""
    scene = scenes.live(session_id)
    if scene is None:
        return
    robot, _, exposure = live.newest() if live else (None, None, None)
    if robot is None or robot.base_from_tool0 is None:
        scene.follow(None)
        return
    seen = exposure.points if exposure else np.empty((0, 2))
    scene.follow(RobotNow(robot.base_from_tool0, seen[:: max(1, len(seen) // _MOST_POINTS)]))
