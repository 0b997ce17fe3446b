"""What a capture must agree with, and why there is none or it is left out again."""

from collections import deque
from typing import Any

import numpy as np

from calib_core.captures.standstill import is_resting
from calib_core.errors import ConflictError
from calib_core.messages import message
from server.live.exposures import in_short
from server.live.live_captures import Shot
from server.live.standstill import Rest
from server.sources.device import Sample, host_now_s

_POSES_AGREE_MM, _POSES_AGREE_RAD = 1.0, 0.005
_WAITS_S = 8.0


class Shots(deque[Shot]):
    """Captures that were asked for and wait, the first to come first."""

    def expire(self) -> None:
        """Answer those that waited too long."""
        while self and host_now_s() - self[0].asked_s > _WAITS_S:
            shot = self.popleft()
            shot.answer.set_exception(no_standstill(shot))

    def end(self) -> None:
        """Answer all: there is no scanner any more."""
        while self:
            self.popleft().answer.set_exception(no_scanner())


def told_standing(shot: Shot) -> list[Sample]:
    """Return a robot that stands where its program says it does, for a cell in which no other source tells."""
    if shot.pose is None:
        return []
    times: Any = np.arange(shot.asked_s, host_now_s() + 0.1, 0.1)
    return [Sample(float(t), base_from_tool0=shot.pose) for t in times]


def require_agreement(shot: Shot, rest: Rest) -> None:
    """Refuse a pose from a program that the robot's own source contradicts."""
    own = rest.robot.base_from_tool0 if rest.robot else None
    if shot.pose is None or own is None or is_resting([own, shot.pose], _POSES_AGREE_MM, _POSES_AGREE_RAD):
        return
    apart_mm = float(np.linalg.norm(own.translation_mm - shot.pose.translation_mm))
    need = "one pose from the robot's program and its source"
    to_do = "Send the flange's pose in the base: tool 0, base 0."
    raise ConflictError(need, "two that are {apart_mm:.1f} mm apart", to_do, "pose", apart_mm=apart_mm)


def require_good(rest: Rest) -> None:
    """Refuse an arc that says too little."""
    if rest.chosen.weak:
        raise ConflictError("a good arc of the sphere", *in_short(rest.chosen.weak))


def require_undisturbed(against: str, is_turned: bool) -> None:
    """Refuse a recording that something spoke against, or during which an armed mover turned the table."""
    if is_turned:
        to_do = "Turn it between sweeps."
        raise ConflictError("a table at rest during a sweep", "one that turns", to_do, "table_deg")
    if against:
        raise ConflictError("poses and a stripe that agree", against, "Record again.")


def no_scanner() -> ConflictError:
    """Return what is said where no scanner is connected."""
    return ConflictError("a scanner that is connected", "none", "Connect one in the session's devices.", "devices")


def no_standstill(shot: Shot) -> ConflictError:
    """Return what is said where none came in time."""
    need, why_not = "a standstill that robot, table and stripe prove", shot.why_not or "no exposure since"
    return ConflictError(need, why_not, "Let the arm settle, then ask again.")


def held_up(held_s: float) -> str:
    """Return what a capture waits for where this computer let nothing run."""
    return message("this computer, which was held up for {held_s:.1f} s", held_s=held_s)


def stood_unseen(nobody_s: float) -> str:
    """Return what a capture waits for where the robot may have gone on unseen, its pose not being sent."""
    return message(
        "the robot or the table to go elsewhere: this computer was held up for {nobody_s:.1f} s as it came here",
        nobody_s=nobody_s,
    )


def left_out(nobody_s: float) -> str:
    """Return why a capture is left out once the robot went on; `nobody_s` is for how long nobody looked then."""
    if nobody_s:
        return message(
            "This computer was held up for {nobody_s:.1f} s as the robot went on: nobody saw whether its pose was "
            "still being sent by then. If it was, take it in again.",
            nobody_s=nobody_s,
        )
    return message(
        "The stripe moved on while the pose stood: one of them perhaps was not sent any more by then, or "
        "late. If scanner or sphere were moved by hand, take it in again."
    )
