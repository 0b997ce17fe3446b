"""Lists of joints among files: taken with the poses that lie beside them, or poses by the arm that was told."""

from collections.abc import Sequence
from dataclasses import replace

from calib_core.arms.kinematics import arm_of, flange_of_joints
from calib_core.poses.numbers import to_pose
from calib_core.recognition.taken import Look, PoseList, PoseRow, Reason


def with_joints(looks: Sequence[Look], arm: str | None, convention: str | None) -> list[Look]:
    """Return looks in which each list of joints goes with a list of poses, or is one by the arm's lengths."""
    found = list(looks)
    for k, look in enumerate(looks):
        if not look.joints or look.poses is not None:
            continue
        other = next((n for n, one in enumerate(found) if one.poses and _alike(one.poses.rows, look.joints)), None)
        if other is not None and (poses := found[other].poses) is not None:
            found[other] = replace(found[other], poses=replace(poses, rows=_beside(poses.rows, look.joints)))
            reason = Reason("joints-of", {"poses": len(poses.rows), "other": found[other].file.name})
            found[k] = replace(look, taken_for="poses", reason=reason)
        elif arm is not None and len(arm_of(arm).joints) == len(look.joints[0].joints_deg or ()):
            reason = Reason("joints-by-arm", {"poses": len(look.joints), "arm": arm})
            made = [_posed(row, arm, convention or "matrix") for row in look.joints]
            poses = PoseList(tuple(made), (convention or "matrix",))
            found[k] = replace(look, taken_for="poses", reason=reason, poses=poses)
    return found


def _alike(poses: Sequence[PoseRow], joints: Sequence[PoseRow]) -> bool:
    """Return whether joints are of poses that have none: by their names, or as many in one order without names."""
    if any(row.joints_deg for row in poses):
        return False
    names = {row.name for row in joints}
    if len(names) == len(joints) and all(row.name for row in joints):
        return all(row.name in names for row in poses)
    return len(poses) == len(joints) and not any(row.name for row in (*poses, *joints))


def _beside(poses: Sequence[PoseRow], joints: Sequence[PoseRow]) -> tuple[PoseRow, ...]:
    by_name = {row.name: row for row in joints}
    own = joints if len(by_name) < len(joints) else [by_name[row.name] for row in poses]
    return tuple(replace(row, joints_deg=one.joints_deg) for row, one in zip(poses, own, strict=True))


def _posed(row: PoseRow, arm: str, convention: str) -> PoseRow:
    assert row.joints_deg is not None
    return replace(row, numbers=tuple(to_pose(convention, flange_of_joints(arm_of(arm), row.joints_deg))))
