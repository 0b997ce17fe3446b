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


Program = Callable[[Sequence[str], Sequence[tuple[list[float], list[float]]], Any], Sequence[str]]


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
        (comments, [(approach, target), …], settings) to the program's lines; poses are the tool's, in the base.
    """

    def numbers(pose: RigidTransform) -> list[float]:
        return to_pose(convention, RigidTransform(pose.matrix, "base", "tool0"))

    def write(answer: Answer, chosen: CheckSettings) -> str:
        move = check_move(answer, chosen)
        comments = [
            *provenance(answer),
            "CHECK MOVE: go through it in manual mode at reduced speed, one target at a time",
            "the operator starts every target; the sphere must stand where it stood",
            f"at each target the scanner should show {move.expected()}",
        ]
        sides = [(numbers(target.approach), numbers(target.base_from_laser)) for target in move.targets]
        return "\r\n".join(program(comments, sides, chosen)) + "\r\n"

    return Export(f"{brand}-check-move", f"{title}: check move", "text/plain", suffix, write, settings, brand)
