"""Recalibrates a cell every night through REST, and puts in force only what may be used.

    scancell serve                                        # in another terminal
    python docs/examples/night_run.py http://127.0.0.1:8000 [--nights 60]

The cell is simulated: its tool drifts by a hundredth of a millimetre a night, one night the sphere is knocked over
half-way, and one day the scanner is hit.  `Nights` is what a real cell's program would do; each night it

- approves: the new answer is fresh, passes, and is no further from the last one than drift and uncertainty allow;
- measures again (recheck) where it is not, for most of what goes wrong at night is gone the second time;
- holds where the second measurement cannot be used either: the answer in force stays;
- raises an alarm where both agree that the tool has moved, or both find a drift: somebody has to look before it is
  released.  A step that only the first measurement made is acknowledged by name.
"""

import argparse
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from scancell_client import ProblemError, Scancell

DRIFT_MM, HIT_MM, KNOCKED_MM = 0.01, np.array([2.5, 0.3, 2.0]), np.array([2.0, -1.5, 0.0])
Taken = Iterable[tuple[dict[str, Any], Mapping[str, bytes]]]


@dataclass(frozen=True)
class Night:
    """What was done in a night: `approve`, `hold` or `alarm`; whether after a recheck, why, of which session."""

    did: str
    rechecked: bool
    why: str
    session: str


class Nights:
    """The unattended calibration of one cell.

    Parameters
    ----------
    api : Scancell
    cell : mapping
        The session's cell, with its `id`.
    measure : callable
        Takes all captures anew; returns their records and files.
    seen_at_mm : (3,)
        Where the scanner sees the work, in its own frame.
    limit_mm : float
        How far the tool may move there from one release to the next, beside what uncertainty explains (k = 3).
    """

    def __init__(
        self,
        api: Scancell,
        cell: Mapping[str, Any],
        measure: Callable[[], Taken],
        seen_at_mm: Any = (0.0, 0.0, 180.0),
        limit_mm: float = 0.5,
    ) -> None:
        self._api, self._cell, self._measure = api, cell, measure
        self._seen_at_mm, self._limit_mm = np.array(seen_at_mm), limit_mm

    def run(self) -> Night:
        """Calibrate, and decide."""
        session, answer, why = self._calibrate()
        if answer is not None and not (why := self._changed(answer)):
            return self._approve(session, rechecked=False)
        first, (session, answer, fault) = answer, self._calibrate()
        if answer is None:
            return Night("hold", True, f"{why}; then {fault}", session)
        moved = self._moved(answer, self.in_force())
        if not moved and "drift" in answer["faults"]:
            if first is not None and not self._moved(first, self.in_force()):
                return Night("alarm", True, "both measurements find a drift", session)
            explained = f"only the first measurement was off: {why}"
            self._api.cells_acknowledge_fault(self._cell["id"], {"fault": "drift", "why": explained[:1000]})
        if not moved:
            return self._approve(session, rechecked=True, why=why)
        if first is not None and not self._moved(answer, first):
            return Night("alarm", True, moved, session)
        return Night("hold", True, f"{why}; then {moved}: the two contradict each other", session)

    def in_force(self) -> dict[str, Any] | None:
        """Return the answer that the cell works with; None before the first release."""
        try:
            return self._api.cells_get_released(self._cell["id"])
        except ProblemError as problem:
            if problem.status == 404:
                return None
            raise

    def _calibrate(self) -> tuple[str, dict[str, Any] | None, str]:
        """Return a new session and its answer, None with the reason where it may not be used."""
        session: str = self._api.sessions_create({"name": self._cell["id"], "cell": self._cell})["id"]
        for record, files in self._measure():
            with suppress(ProblemError):  # nothing came back to the scanner: the others may be enough
                self._api.captures_add(session, record, files)
        try:
            self._api.solve(session, "tcp")
        except ProblemError as problem:
            return session, None, str(problem)
        answer = self._api.answers_get_answer(session)
        if set(answer["faults"]) <= {"drift"} and answer["verdict"] == "pass":
            return session, answer, ""
        return session, None, "; ".join([*answer["faults"], *answer["warnings"]])

    def _changed(self, answer: Mapping[str, Any]) -> str:
        """Return why an answer has to be measured again; nothing where it is as expected."""
        moved = self._moved(answer, self.in_force())
        return moved or ("the cell has drifted" if "drift" in answer["faults"] else "")

    def _moved(self, new: Mapping[str, Any], old: Mapping[str, Any] | None) -> str:
        """Return by how much the tool has moved where it works; nothing where that is to be expected."""
        if old is None:
            return ""
        shift = _at(new, self._seen_at_mm) - _at(old, self._seen_at_mm)
        covariance = _covariance_at(new, self._seen_at_mm) + _covariance_at(old, self._seen_at_mm)
        sigma = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
        moved, allowed = float(np.linalg.norm(shift)), self._limit_mm + 3 * sigma
        return f"the tool moved by {moved:.2f} mm, more than {allowed:.2f} mm" if moved > allowed else ""

    def _approve(self, session: str, rechecked: bool, why: str = "") -> Night:
        note = f"night run, after a recheck: {why}" if rechecked else "night run"
        self._api.cells_release(session, {"why": note[:1000]})
        return Night("approve", rechecked, why, session)


def _at(answer: Mapping[str, Any], point_mm: Any) -> Any:
    matrix = np.array(answer["tool0_from_laser"]["matrix"])
    return matrix[:3, :3] @ point_mm + matrix[:3, 3]


def _covariance_at(answer: Mapping[str, Any], point_mm: Any) -> Any:
    """Return the covariance of a point that the scanner sees, in the flange's frame."""
    x, y, z = point_mm
    rotation = np.array(answer["tool0_from_laser"]["matrix"])[:3, :3]
    crossed = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    jacobian = np.hstack([-rotation @ crossed, np.eye(3)])
    return jacobian @ np.array(answer["tool0_from_laser"]["covariance"]) @ jacobian.T


class DriftingCell:
    """The simulated cell: `begin` a night, then `measure` as often as wanted."""

    def __init__(self, hit_in: int, knocked_in: int, seed: int = 7) -> None:
        from calib_core.simulation import simulate

        self._simulated = simulate("tcp", seed)
        self._hit_in, self._knocked_in = hit_in, knocked_in
        self._number, self._takes = 0, 0
        self.cell: dict[str, Any] = {**self._simulated.session.to_json()["cell"], "id": "press-7"}

    def begin(self, number: int) -> None:
        """Let a day pass: the tool drifts, and one day somebody hits the scanner."""
        assert self._simulated.world is not None
        self._number, self._takes = number, 0
        tool = self._simulated.world.tool0_from_laser.copy()
        tool[2, 3] += DRIFT_MM
        if number == self._hit_in:
            tool[:3, 3] += tool[:3, :3] @ HIT_MM
        self._simulated = replace(self._simulated, world=replace(self._simulated.world, tool0_from_laser=tool))

    @property
    def tool0_from_laser(self) -> Any:
        """The truth."""
        assert self._simulated.world is not None
        return self._simulated.world.tool0_from_laser

    def measure(self) -> Taken:
        """Take all captures; one night the sphere is knocked over during the first run through them."""
        from calib_core.simulation import retake

        simulated, world = self._simulated, self._simulated.world
        assert world is not None
        knocked = self._number == self._knocked_in and not self._takes
        self._takes += 1
        for place, shot in enumerate(world.shots):
            if knocked and place == len(world.shots) // 2:
                center = world.sphere_center_in_base_mm + KNOCKED_MM
                simulated = replace(simulated, world=replace(world, sphere_center_in_base_mm=center))
            seed = (self._number * 10 + self._takes) * 100 + place
            capture, files = retake(simulated, shot.name, shot.name, seed)
            yield capture.to_json(), files


def main() -> None:
    """Run so many nights, and print what was done in each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("address")
    parser.add_argument("--nights", type=int, default=60)
    options = parser.parse_args()
    cell = DriftingCell(hit_in=options.nights // 3, knocked_in=options.nights * 2 // 3)
    with Scancell(options.address) as api:
        nights = Nights(api, cell.cell, cell.measure)
        for number in range(1, options.nights + 1):
            cell.begin(number)
            night = nights.run()
            print(
                f"{number:3} {night.did}{' (after a recheck)' if night.rechecked else ''} {night.why}", flush=True
            )
            if night.did == "alarm":  # in the morning somebody looks, finds the dent, and says so
                why = "the scanner was hit; new place confirmed"
                api.cells_acknowledge_fault(cell.cell["id"], {"fault": "drift", "why": why})
                api.cells_release(night.session, {"why": why})


if __name__ == "__main__":
    main()
