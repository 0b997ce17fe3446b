"""A frame as a block: in a convention, each number with its uncertainty."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from calib_core.cell.found import UpToShift
from calib_core.evidence.numbers import number_text, quantity, quantity_text, same_decimals
from calib_core.exports.export import tool_number_sigmas, tool_numbers
from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import message
from calib_core.poses.conventions import CONVENTIONS
from calib_core.records import Session
from calib_core.records.evidence import (
    Frame,
    FrameNumber,
    Note,
)


def frame_block(
    convention_name: str, frame: RigidTransform, covariance: Sequence[Sequence[float]] | None, **about: Any
) -> Frame:
    """Return a frame in a convention, each number with its uncertainty; of a matrix, the translation.

    Parameters
    ----------
    convention_name : str
    frame : RigidTransform
    covariance : (6, 6), optional
        Of rx ry rz tx ty tz, the rotation perturbing on the right.
    about
        The block's `title`, `id` and `detail`.
    """
    convention = CONVENTIONS[convention_name]
    return Frame(
        name=f"{frame.into}_from_{frame.outof}",
        into=frame.into,
        outof=frame.outof,
        matrix=frame.to_rows(),
        covariance=None if covariance is None else [list(row) for row in covariance],
        convention=convention.name,
        units=f"{convention.name}, {convention.units}",
        formula=convention.formula,
        numbers=list(_frame_numbers(convention.name, frame, covariance)),
        **about,
    )


def open_frame(
    session: Session,
    frame: RigidTransform,
    title: str,
    shift: UpToShift,
    covariance: Sequence[Sequence[float]] | None,
) -> Note:
    """Return how a frame is turned, in the session's convention, where its position is open."""
    if shift.travel is not None:
        return Note(title=title, text=message("Not determined by itself: all poses lie on one line."))
    convention = CONVENTIONS[session.cell.pose_convention]
    if convention.form == "matrix":
        numbers = ", ".join(f"{value:.6f}" for value in frame.rotation.ravel())
    else:
        turned = None if covariance is None else np.array(covariance, dtype=float)[:6, :6]
        if turned is not None:
            turned[3:] = turned[:, 3:] = 0.0  # open, and nothing to how it is turned
            turned = turned if np.isfinite(turned).all() else None
        shown = list(_frame_numbers(convention.name, frame, turned))[3:]
        numbers = ", ".join(f"{one.label} = {quantity_text(one.quantity)}" for one in shown)
    text = message(
        "Orientation ({convention}): {numbers}. Its position is not determined: no turn tells it.",
        convention=convention.name,
        numbers=numbers,
    )
    return Note(title=title, text=text)


def _frame_numbers(
    name: str, frame: RigidTransform, covariance: FloatArray | Sequence[Sequence[float]] | None
) -> Iterator[FrameNumber]:
    convention = CONVENTIONS[name]
    if convention.form == "matrix":
        sigmas = np.zeros(6) if covariance is None else np.sqrt(np.diag(np.array(covariance, dtype=float)[:6, :6]))
        shown = same_decimals(
            [quantity(v, "mm", s) for v, s in zip(frame.translation_mm, sigmas[3:], strict=True)]
        )
        yield from (FrameNumber(label=label, quantity=one) for label, one in zip("xyz", shown, strict=True))
        return
    as_tool = RigidTransform(frame.matrix, "tool0", "laser")  # numbers of a pose, whatever its frames are called
    square = np.zeros((6, 6)) if covariance is None else np.array(covariance, dtype=float)[:6, :6]
    sigmas = tool_number_sigmas(name, as_tool, square)
    angle = {"quaternion": "", "rotation-vector": "rad"}.get(convention.form, "°")
    lengths = "m" if convention.mm_per_unit == 1000 else "mm"
    labels = convention.numbers.split()
    values = zip(labels, tool_numbers(name, as_tool), sigmas, strict=True)
    shown = [
        quantity(value, lengths if k < 3 else angle, None if covariance is None else sigma)
        for k, (_, value, sigma) in enumerate(values)
    ]
    for label, one in zip(labels, [*same_decimals(shown[:3]), *same_decimals(shown[3:])], strict=True):
        yield FrameNumber(label=label, quantity=one)


def pose_sigmas(covariance: Sequence[Sequence[float]]) -> tuple[float, float]:
    """Return the standard deviations of position (mm) and orientation (deg) in their worst directions."""
    square = np.array(covariance, dtype=float)[:6, :6]
    position = float(np.sqrt(max(np.linalg.eigvalsh(square[3:, 3:])[-1], 0.0)))
    return position, float(np.rad2deg(np.sqrt(max(np.linalg.eigvalsh(square[:3, :3])[-1], 0.0))))


def direction_text(direction: Sequence[float], sigma_rad: float) -> str:
    """Return a unit vector with as many decimals as the standard deviation of its direction allows."""
    decimals = quantity(1.0, "", sigma_rad).decimals if sigma_rad > 0 else 6
    return f"({', '.join(number_text(value, decimals) for value in direction)})"
