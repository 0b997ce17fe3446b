"""A planned set as a brand's program: each pose approached from well outside, slowly, started by the operator."""

from dataclasses import dataclass

from calib_core.errors import ConflictError, InputError
from calib_core.exports.check_move import CheckSettings
from calib_core.exports.check_programs import UNTRIED, MoveExport, Moves, Stop
from calib_core.exports.registry import all_exports
from calib_core.exports.writing import ascii_of
from calib_core.frames import RigidTransform
from calib_core.guidance.pose_list import PoseList
from calib_core.poses.numbers import parse_pose, to_pose
from calib_core.proof import Proof
from calib_core.records import Session


@dataclass(frozen=True)
class PlannedProgram:
    """A program's file."""

    name: str
    media_type: str
    content: bytes
    proof: Proof | None


def program_brands() -> tuple[str, ...]:
    """Return the brands that planned sets can be written for."""
    return tuple(entry.brand for entry in all_exports() if isinstance(entry, MoveExport))


def planned_program(session: Session, plan: PoseList, brand: str) -> PlannedProgram:
    """Return a planned set as a brand's program, by the poses of the flange.

    Parameters
    ----------
    session : Session
        For its name and its convention, in which the plan's numbers are.
    plan : PoseList
    brand : str
        One of `program_brands`.

    Raises
    ------
    InputError
        If the brand has no such program.
    ConflictError
        If the tool is not known well enough for approaches: nobody should move by it.
    """
    entry = next((e for e in all_exports() if isinstance(e, MoveExport) and e.brand == brand), None)
    if entry is None:
        raise InputError.unknown(brand, program_brands(), "brand")
    if not plan.by_robot:
        to_do = "Move the axes alone, to the angles of the list."
        raise ConflictError("captures for which the robot moves", "others", to_do, "planned")
    approaches = [pose.approach_numbers for pose in plan.poses]
    stops: list[Stop] = []
    for number, (pose, approach) in enumerate(zip(plan.poses, approaches, strict=True), start=1):
        if approach is None:
            to_do = "Drive to the first poses by hand, or give `cell.nominal.tool_sigma_mm` from a drawing."
            raise ConflictError("a tool that is known to ± 10 mm", "one that is known less well", to_do, "planned")
        title = f"pose {number}"
        if pose.higher_mm:
            title += f", fix the sphere {pose.higher_mm:+.0f} mm higher first"
        if pose.table_deg is not None:
            title += f", table at {pose.table_deg:.1f} deg"
        title += "".join(f", {name} at {value:.1f} deg" for name, value in (pose.axes_deg or {}).items())
        title += "".join(f", {name} at {value:.1f} mm" for name, value in (pose.axes_mm or {}).items())
        target = RigidTransform.from_rounded(pose.base_from_tool0, "base", "tool0")
        outside = parse_pose(plan.pose_convention, approach)
        stops.append(Stop(title, to_pose(entry.convention, outside), to_pose(entry.convention, target)))
    chosen = entry.settings.model_validate({"speed_mm_s": plan.speed_mm_s})
    assert isinstance(chosen, CheckSettings)
    comments = [
        f"scancell: planned poses of the flange in base, of session {ascii_of(session.name) or 'without a name'}",
        f"step {plan.step}: {len(stops)} captures of the sphere, the most helpful one first",
        UNTRIED,
        "PLANNED MOVES: go through them in manual mode at reduced speed, one at a time",
        "the operator starts every move; the sphere must stand where it stood when they were planned",
        "between poses the program goes straight from approach to approach: see that this way is free",
    ]
    moves = Moves("plan", comments, stops, "the pose", "capture", None)
    content = entry.written(moves, chosen)
    data = content if isinstance(content, bytes) else content.encode("ascii")
    return PlannedProgram(f"planned-{plan.step}{entry.suffix}", entry.media_type, data, entry.proof)
