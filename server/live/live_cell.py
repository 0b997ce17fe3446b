"""A session's live cell: its links, the newest readings, and the thread that takes captures from them."""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from calib_core.clock_offset import ClockOffset
from calib_core.errors import CalibrationError, ConflictError
from calib_core.findings import sentence_of
from calib_core.messages import message
from calib_core.records import Capture, Cell
from calib_core.steps import steps_that_show
from server.live.agreement import Agreement
from server.live.clock_watch import MeasuredClocks, SeenArc
from server.live.exposures import Exposure, Optics, exposure_of
from server.live.held_up import Pulse
from server.live.link import Link, Links
from server.live.live_captures import (
    CaptureSettings,
    LeaveOut,
    Shot,
    Take,
    Taken,
    capture_of_rest,
    capture_of_sweep,
)
from server.live.recording import Recording, newest_way, on_one_clock, sweep_fields, table_fields
from server.live.shots import (
    Shots,
    held_up,
    left_out,
    no_scanner,
    require_agreement,
    require_good,
    require_undisturbed,
    stood_unseen,
    told_standing,
)
from server.live.standstill import Rest, Rules, is_new_place, stood_still
from server.sources.device import Frame, Reading, Sample, host_now_s
from server.store.audit import acting_as

log = logging.getLogger("scancell")

_SAMPLES, _EXPOSURES, _SEEN = 4000, 12, 1200
_IDLE_S = 0.1


class LiveCell:
    """Devices of a session while they are connected.

    Parameters
    ----------
    load : callable
        Returns the session's cell, its captures' ids, and what turns a camera's stripe into points; raises
        CalibrationError.
    take : callable
        Stores a capture.
    settings : CaptureSettings
    leave_out : callable, optional
        Excludes a capture whose pose turned out to be none.
    """

    def __init__(
        self,
        load: Callable[[], tuple[Cell, set[str], Optics]],
        take: Take,
        settings: CaptureSettings,
        rules: Rules | None = None,
        clocks: MeasuredClocks | None = None,
        leave_out: LeaveOut = lambda _, __: None,
    ) -> None:
        self._load, self._take, self._leave_out = load, take, leave_out
        self._settings, self.rules = settings, rules or Rules()
        self.links = Links()
        self._robot: deque[Sample] = deque(maxlen=_SAMPLES)
        self._table: deque[Sample] = deque(maxlen=_SAMPLES)
        self._with_angle: set[str] = set()  # devices that have told the table's angle, and may be silent now
        self._exposures: deque[Exposure] = deque(maxlen=_EXPOSURES)
        self._seen: deque[SeenArc] = deque(maxlen=_SEEN)
        self._frame: Frame | None = None
        self._shots = Shots()
        self._arrived = threading.Condition()
        self._stopped = False
        self._taken_at: tuple[Sample | None, float | None] | None = None
        self._pulse = Pulse()
        self._agreement = Agreement(self.rules, self._pulse.unwatched_s)
        self._taken_here: tuple[str, float] | None = None  # the last capture, and since when the pose had stood
        self.last: Taken | None = None
        self.waits_for = ""
        self.is_taken = False  # where all stand now, a capture was taken already
        self.turned_s = -np.inf  # until when an armed mover turned the table, inf while it does
        self.clocks = clocks or MeasuredClocks()
        self.clock_watch = self.clocks.watch
        self.recording: Recording | None = None
        self.version = 0
        self._thread = threading.Thread(target=self._run, name="live cell", daemon=True)
        self._thread.start()

    @property
    def settings(self) -> CaptureSettings:
        """What captures are taken for."""
        return self._settings

    @settings.setter
    def settings(self, settings: CaptureSettings) -> None:
        with self._arrived:
            self._settings = settings
            # Another step or mounting: the sphere may have been moved by hand.
            self._agreement.forget(is_remounted=True)

    def add(self, link: Link) -> None:
        """Take a device's link in place of the one of its name, and start it."""
        self.remove(link.name)
        self.links[link.name] = link
        link.start()

    def remove(self, name: str) -> None:
        """End a device's link, if there is one."""
        link = self.links.pop(name, None)
        self._with_angle.discard(name)
        if link is not None:
            link.stop()
            self.forget(name, link)

    def stop(self) -> None:
        """End all links and the thread."""
        with self._arrived:
            self._stopped = True
            self._arrived.notify_all()
        for name in list(self.links):
            self.remove(name)
        self._thread.join(timeout=10)
        self._pulse.stop()

    def arrived(self, name: str, reading: Reading) -> None:
        """Take a reading; called by links' threads.  Of frames the newest is kept: previews may be dropped."""
        with self._arrived:
            recording = self.recording
            if isinstance(reading, Frame):
                self.clock_watch.scanner.take(reading)
                if recording is not None:
                    recording.expose(reading)
                self._frame, self._pulse.newest_s = reading, reading.host_time_s
                self._arrived.notify_all()
                return
            link = self.links.get(name)
            delivers = link.source.delivers if link is not None else ()
            self._agreement.tell(reading)
            if reading.base_from_tool0 is not None and "robot" in delivers:
                self._robot.append(reading)
                self.clock_watch.robot.take(reading)
                if recording is not None:
                    recording.move(reading)
            if reading.table_deg is not None and "table" in delivers:
                self._table.append(reading)
                self._with_angle.add(name)

    def forget(self, name: str, link: Link | None = None) -> None:
        """Forget what a device told: what comes next does not connect to it, and nothing may be joined across."""
        link = link or self.links.get(name)
        if link is None:
            return
        with self._arrived:
            if self.recording is not None and {"robot", "scanner", "table"} & set(link.source.delivers):
                self.recording.fail(message("{who} was lost meanwhile", who=name))
            if "robot" in link.source.delivers:
                self._robot.clear()
                self.clock_watch.robot.clear()
            if "table" in link.source.delivers:
                self._table.clear()
            if "scanner" in link.source.delivers:
                self._exposures.clear()
                self._seen.clear()
                self._frame = None
                self.clock_watch.scanner.clear()
            self._agreement.forget(is_remounted=False)
            self.version += 1

    def ask(self, shot: Shot) -> None:
        """Have a capture taken; `shot.answer` tells how it went.

        Raises
        ------
        ConflictError
            If no scanner is connected.
        """
        if not self.links.of("scanner"):
            raise no_scanner()
        with self._arrived:
            self._shots.append(shot)
            self._arrived.notify_all()
        for link in self.links.of("scanner"):
            link.trigger()

    @property
    def state(self) -> tuple[int, list[str]]:
        """What differs once something new has come or a device's status has changed."""
        return self.version, [link.state().status for link in list(self.links.values())]

    def newest_table(self) -> Sample | None:
        """Return the newest sample that tells the table's angle."""
        with self._arrived:
            return self._table[-1] if self._table else None

    def newest(self) -> tuple[Sample | None, float | None, Exposure | None]:
        """Return the newest sample of the robot, angle of the table, and exposure."""
        with self._arrived:
            robot = self._robot[-1] if self._robot else None
            table_deg = self._table[-1].table_deg if self._table else None
            return robot, table_deg, self._exposures[-1] if self._exposures else None

    def clock_offset(self) -> tuple[ClockOffset, str]:
        """Return how much more the scanner's clock tells than the robot's, and which clocks these are.

        Raises
        ------
        MotionError, MeasurementError
            If the newest readings are not of a move back and forth with the sphere in view.
        """
        with self._arrived:
            robot, seen = newest_way(self._robot), list(self._seen)
        return self.clocks.measure(robot, seen)

    def sweep(self, shot: Shot, seconds: float, folder: Path) -> Taken:
        """Record exposures and poses for a while, on the move or not, and store them as one capture.

        Raises
        ------
        ConflictError
            If something is recorded already, a device was lost or not fresh, an armed mover turned the table, or
            the offset between the clocks is not known well enough for the speed.
        MeasurementError
            If exposures or poses are missing.
        """
        with self._arrived:
            if self.recording is not None:
                raise ConflictError("one recording at a time", "one that runs", "Wait for its end.")
            recording = self.recording = Recording(folder)
            for sample in list(self._robot)[-50:]:  # exposures may tell times of just before
                recording.move(sample)
            began_s = host_now_s()
        time.sleep(seconds)
        with self._arrived:
            self.recording, ended_s = None, host_now_s()
            table = [sample for sample in self._table if sample.host_time_s >= began_s]
            against = self._agreement.contradicted_since(began_s, self.links.are_stamped("scanner"))
        recorded = recording.end()
        require_undisturbed(against, self.turned_s >= began_s)
        cell, taken, _ = self._load()
        kept, frames_s, track_s = on_one_clock(recorded, self.clocks)
        fields = sweep_fields(kept, frames_s, track_s, self.clocks.offset, cell.pose_convention)
        fields |= table_fields(table, self.rules, (began_s, ended_s) if self._with_angle else None)
        capture, files = capture_of_sweep(kept, fields, self.settings, taken, shot)
        return self._keep(capture, files, shot)

    def _run(self) -> None:
        while True:
            with self._arrived:
                if self._frame is None and not self._stopped:
                    self._arrived.wait(_IDLE_S)
                if self._stopped:
                    break
                frame, self._frame = self._frame, None
            try:
                if frame is not None:
                    self._look(frame)
            except CalibrationError as error:
                self.waits_for = str(error)
            except Exception:  # one exposure's fault must not end the watching
                log.exception("a live cell")
                self.waits_for = "Looking at an exposure failed; the server's log says more."
            self._shots.expire()
        self._shots.end()

    def _look(self, frame: Frame) -> None:
        cell, taken, optics = self._load()
        exposure = exposure_of(frame, cell, optics)
        with self._arrived:
            self._exposures.append(exposure)
            self._agreement.see(exposure, is_on_table=self._is_on_table)
            together, self._agreement.departures.together = self._agreement.departures.together, None
            if together is not None:
                self.links.believe(together)
            if exposure.arc is not None:
                moment_s = frame.device_time_s
                arc = np.array([*exposure.arc.center_mm, exposure.arc.radius_mm])
                self._seen.append(
                    SeenArc(frame.host_time_s if moment_s is None else moment_s, moment_s is not None, arc)
                )
            robot, table, exposures = list(self._robot), list(self._table), list(self._exposures)
        self.version += 1
        self._look_back()
        if self._shots:
            self._serve(self._shots[0], cell, taken, robot, table, exposures)
            return
        rest = self._agreed(
            stood_still(robot, exposures, self.rules, table, self.links.are_timed("scanner")), cell
        )
        weak = None if isinstance(rest, str) else rest.chosen.weak
        self.waits_for = rest if isinstance(rest, str) else "" if weak is None else sentence_of(weak)
        self.is_taken = False
        if isinstance(rest, str) or self.waits_for or not self.settings.automatic:
            return
        if self._taken_at is None or is_new_place(rest, *self._taken_at):
            self._store(cell, rest, taken, None)
        else:
            self.is_taken = True
            self.waits_for = "the robot or the table to go to another place"

    def _serve(
        self,
        shot: Shot,
        cell: Cell,
        taken: set[str],
        robot: list[Sample],
        table: list[Sample],
        exposures: list[Exposure],
    ) -> None:
        after = [e for e in exposures if e.frame.host_time_s >= shot.asked_s + self.rules.latency_s]
        rest = stood_still(
            robot or told_standing(shot), after, self.rules, table, not robot or self.links.are_timed("scanner")
        )
        rest = self._agreed(rest, cell) if robot else rest
        if isinstance(rest, str):
            shot.why_not = rest
            return
        self._shots.popleft()
        try:
            require_agreement(shot, rest)
            require_good(rest)
            shot.answer.set_result(self._store(cell, rest, taken, shot))
        except CalibrationError as error:
            shot.answer.set_exception(error)

    def _agreed(self, rest: Rest | str, cell: Cell) -> Rest | str:
        """Return a standstill that poses and stripe do not contradict, or why there is none.

        Where the sphere stands on a table that tells no angle, it may have been turned by hand.
        """
        if (late := self._agreement.late_angle.why) or isinstance(rest, str):
            return late or rest
        began_s = rest.exposures[0].frame.host_time_s
        if self.turned_s >= began_s - self.rules.latency_s:
            return "the table turns"
        if held_s := self._pulse.held_s(began_s - self.rules.untimed_latency_s, host_now_s()):
            return held_up(held_s)
        with self._arrived:
            nobody_s = 0.0 if self.links.are_timed("robot", "table") else self._agreement.unwatched_since_s()
        if nobody_s:
            return stood_unseen(nobody_s)
        if rest.table_deg is None and self._is_on_table:
            return "the table has told nothing yet" if self._with_angle else rest
        with self._arrived:
            told = self._agreement.table_contradiction(rest, cell) if self._is_on_table else ""
            return told or self._agreement.contradiction(rest, self.links.are_timed("scanner")) or rest

    def _look_back(self) -> None:
        """Leave out the last capture where a pose without a time stood before the robot did."""
        with self._arrived:
            doubted_s, self._agreement.doubted_since_s = self._agreement.doubted_since_s, None
            nobody_s = self._agreement.nobody_looked_s
        if doubted_s is None or self._taken_here is None or self._taken_here[1] != doubted_s:
            return
        name, self._taken_here = self._taken_here[0], None
        by_hand = self._is_on_table and not self._with_angle
        timed = ("robot", "table", "scanner") if self._agreement.is_late() else ("robot", "table")
        if by_hand or self.links.are_timed(*timed):
            return
        self._leave_out(name, left_out(nobody_s))
        self.version += 1

    @property
    def _is_on_table(self) -> bool:
        """Whether the sphere that is captured is on the table."""
        return self.settings.step in steps_that_show("sphere-on-table")

    def _store(self, cell: Cell, rest: Rest, taken: set[str], shot: Shot | None) -> Taken:
        devices = ", ".join(f"{link.name} ({link.source.name})" for link in self.links.values())
        capture, files = capture_of_rest(cell, rest, self.settings, taken, shot, devices)
        since_s = self._agreement.stands_since_s
        told = self._keep(capture, files, shot)
        self._taken_here = capture.id, since_s
        self._taken_at = rest.robot, rest.table_deg
        return told

    def _keep(self, capture: Capture, files: Mapping[str, bytes], shot: Shot | None) -> Taken:
        with acting_as(shot.act if shot else None):
            measured = self._take(capture, files)
        text = " ".join(filter(None, (measured.reason, measured.to_do)))
        self.last = Taken(capture.id, measured.verdict, measured.zone, text)
        self.version += 1
        return self.last
