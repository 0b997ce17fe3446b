"""Check moves as programs: in a brand's folder stand its lines, here what they have in common."""

from collections.abc import Callable, Sequence
from typing import Any

from pydantic import Field

from calib_core.exports.answer import Answer
from calib_core.exports.check_move import CheckSettings, check_move
from calib_core.exports.entry import Export
from calib_core.exports.writing import Name, provenance
from calib_core.frames import RigidTransform
from calib_core.robots import to_pose


class NumberedCheck(CheckSettings):
    """Which tool of the controller is checked."""

    tool: int = Field(default=1, ge=0, le=999)


class NamedCheck(CheckSettings):
    """Which tool of the controller is checked."""

    tool: Name = "tScanner"


Sides = Sequence[tuple[list[float], list[float]]]
"""Approach and target of each side, poses of the tool in the base."""
Program = Callable[[Sequence[str], Sides, Any], Sequence[str]]


def check_parts(answer: Answer, chosen: CheckSettings, convention: str) -> tuple[list[str], Sides]:
    """Return what stands in every brand's check move: its comments in ASCII, and its poses.

    Raises
    ------
    ConflictError
        If the answer is stale or failed, or not determined.
    InputError
        If the captures do not tell where the sphere stood.
    """

    def numbers(pose: RigidTransform) -> list[float]:
        return to_pose(convention, RigidTransform(pose.matrix, "base", "tool0"))

    move = check_move(answer, chosen)
    comments = [
        *provenance(answer),
        "CHECK MOVE: go through it in manual mode at reduced speed, one target at a time",
        "the operator starts every target; the sphere must stand where it stood",
        f"at each target the scanner should show {move.expected()}",
    ]
    return comments, [(numbers(target.approach), numbers(target.base_from_laser)) for target in move.targets]


def check_export(
    brand: str, title: str, suffix: str, convention: str, settings: type[CheckSettings], program: Program
) -> Export:
    """Return the export of a check move as a brand's program.

    Parameters
    ----------
    brand, title, suffix, convention : str
    settings : type
        With a field `tool`.
    program : callable
        (comments, sides, settings) to the program's lines.
    """

    def write(answer: Answer, chosen: CheckSettings) -> str:
        comments, sides = check_parts(answer, chosen, convention)
        return "\r\n".join(program(comments, sides, chosen)) + "\r\n"

    return Export(f"{brand}-check-move", f"{title}: check move", "text/plain", suffix, write, settings, brand)
