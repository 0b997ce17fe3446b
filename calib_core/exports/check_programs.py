"""Programs that move from pose to pose: check moves and planned sets; in a brand's folder stand its lines."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from pydantic import Field

from calib_core.exports.answer import Answer
from calib_core.exports.check_move import CheckSettings, check_move, checked_tool
from calib_core.exports.entry import Export
from calib_core.exports.writing import Name, provenance, tool_pose
from calib_core.frames import RigidTransform
from calib_core.messages import message
from calib_core.poses.numbers import to_pose


class NumberedCheck(CheckSettings):
    """Which tool of the controller is checked."""

    tool: int = Field(default=1, ge=0, le=999)


class NamedCheck(CheckSettings):
    """Which tool of the controller is checked."""

    tool: Name = "tScanner"


@dataclass(frozen=True)
class Stop:
    """One pose to go to in a straight line from its approach, and back; numbers in the brand's convention."""

    title: str
    approach: list[float]
    target: list[float]

    def named(self, approach: str, target: str) -> list[tuple[str, list[float]]]:
        """Return both with the names of their variables."""
        return [(approach, self.approach), (target, self.target)]


@dataclass(frozen=True)
class Moves:
    """What a program does: the operator starts every move of it.

    Attributes
    ----------
    name : str
        Of the program, behind the prefix that each brand has for it: ``check`` or ``plan``.
    comments : sequence of str
        In ASCII.
    stops : sequence of Stop
    goal, to_do : str
        Where the operator is asked to let it go, and what is to be done there.
    tool : list of float or None
        The tool's numbers that the poses are of; None: the poses are of the flange.
    """

    name: str
    comments: Sequence[str]
    stops: Sequence[Stop]
    goal: str
    to_do: str
    tool: list[float] | None


Program = Callable[[Moves, Any], Sequence[str] | bytes]

UNTRIED = "EXPERIMENTAL: no controller has run this program: read it before it runs"
"""What every program says of itself."""


@dataclass(frozen=True)
class MoveExport(Export):
    """The export of a check move, with the brand's own lines for any moves.

    Parameters
    ----------
    convention : str
        Of the brand's numbers.
    program : callable
        (moves, settings) to the program's lines, or to the bytes of a zip.
    """

    convention: str = field(kw_only=True)
    program: Program = field(kw_only=True)

    def written(self, moves: Moves, settings: CheckSettings) -> str | bytes:
        """Return a program's file."""
        lines = self.program(moves, settings)
        return lines if isinstance(lines, bytes) else "\r\n".join(lines) + "\r\n"


def check_moves(answer: Answer, chosen: CheckSettings, convention: str) -> Moves:
    """Return the check move as every brand's program has it.

    Raises
    ------
    ConflictError
        If the answer is stale or failed, or not determined.
    InputError
        If the captures do not tell where the sphere stood.
    """

    def numbers(pose: RigidTransform) -> list[float]:
        return to_pose(convention, RigidTransform(pose.matrix, "base", "tool0"))

    answer = checked_tool(answer, chosen)
    move = check_move(answer, chosen)
    tool = tool_pose(answer, convention)
    comments = [
        *provenance(answer),
        f"the tool that must be active: {', '.join(f'{number:.6g}' for number in tool)}",
        UNTRIED,
        "CHECK MOVE: go through it in manual mode at reduced speed, one target at a time",
        "the operator starts every target; the sphere must stand where it stood",
        f"at each target the scanner should show {move.expected()}",
    ]
    stops = [
        Stop(f"side {number}", numbers(target.approach), numbers(target.base_from_laser))
        for number, target in enumerate(move.targets, start=1)
    ]
    return Moves("check", comments, stops, "the sphere", "read the scanner", tool)


def check_export(
    brand: str, title: str, suffix: str, convention: str, settings: type[CheckSettings], program: Program
) -> MoveExport:
    """Return the export of a check move as a brand's program.

    Parameters
    ----------
    brand, title, suffix, convention : str
    settings : type
        With a field `tool` where the program names one.
    program : callable
        (moves, settings) to the program's lines, or to the bytes of a zip.
    """

    def write(answer: Answer, chosen: CheckSettings) -> str | bytes:
        return found.written(check_moves(answer, chosen, convention), chosen)

    media_type = "application/zip" if suffix == ".zip" else "text/plain"
    found = MoveExport(
        f"{brand}-check-move", message('{title}: check move', title=title), media_type, suffix, write, settings,
        brand,
        convention=convention, program=program,
    )  # fmt: skip
    return found
