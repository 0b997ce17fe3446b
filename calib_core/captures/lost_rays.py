"""Stripe centres that were dropped as they have no ray: counted as a frame is read, said wherever it counts."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Self, TypeVar

from calib_core.chain.observations import SphereObservation
from calib_core.frames import FloatArray
from calib_core.records import Measured


@dataclass(frozen=True, eq=False)
class SeenPoints:
    """The points of one file, (N, 2) or (N, 3), and how many stripe centres of a raw frame had no ray."""

    points: FloatArray
    without_ray: int = 0


class _Noted(Protocol):
    @property
    def notes(self) -> list[str]: ...

    def model_copy(self, *, update: dict[str, object]) -> Self: ...


_Result = TypeVar("_Result", bound=_Noted)


def lost_rays(dropped: int) -> list[str]:
    """Return what is to be said of centres that were dropped beyond the distortion's fold; nothing of none."""
    return [
        f"{dropped} stripe centres were dropped: they lie beyond the fold of the camera's distortion, where a "
        "pixel has no ray. Show the board there, too, when the camera is calibrated."
    ] * bool(dropped)


def with_lost_rays(result: _Result, observations: Sequence[SphereObservation]) -> _Result:
    """Return a result with what was dropped of the frames that it rests on."""
    said = lost_rays(sum(o.without_ray for o in observations))
    return result.model_copy(update={"notes": [*result.notes, *said]}) if said else result


def telling_lost_rays(measured: Measured) -> Measured:
    """Return what was measured of a capture, the centres that were dropped being told with it."""
    said = lost_rays(measured.without_ray)
    reason = " ".join([*filter(None, [measured.reason]), *said])
    return measured.model_copy(update={"reason": reason}) if said else measured
