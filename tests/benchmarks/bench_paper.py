"""The paper's experiment as one table: tool, axis and a merged ball, by the paper's ways and by the joint ones.

Its claim is that differences of positions carry less error than positions: an arm's own errors are alike at near
poses, those by chance are not; the table has both.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from harness import Row
from paper_cell import RADIUS_MM, Errors, PaperCell, Shot, simulate, turn

from calib_core.arms.errors import arm_moves
from calib_core.captures.arm_joints import corrected_by
from calib_core.chain.circles import paper_axis
from calib_core.chain.two_step import two_step
from calib_core.frames import RigidTransform
from calib_core.records import parse_session
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult
from calib_core.stages.turntable.record import TurntableResult

Axis = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Answer:
    """A tool, an axis (point, direction), and poses of the scans where they are corrected."""

    tool: np.ndarray
    axis: Axis
    poses: list[np.ndarray]


def by_positions(cell: PaperCell) -> np.ndarray:
    """The tool from a ball that was touched: where it is before the flange, and where before the scanner."""
    own = np.array([np.linalg.inv(s.told)[:3] @ [*cell.touched_mm, 1.0] for s in cell.still])
    seen = np.array([s.center_mm for s in cell.still])
    u, _, vt = np.linalg.svd((own - own.mean(axis=0)).T @ (seen - seen.mean(axis=0)))
    tool = np.eye(4)
    tool[:3, :3] = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt
    tool[:3, 3] = own.mean(axis=0) - tool[:3, :3] @ seen.mean(axis=0)
    return tool


def by_differences(cell: PaperCell) -> np.ndarray:
    """The paper's two steps."""
    told = np.array([s.told for s in cell.still])
    found = two_step(told[:, :3, :3], told[:, :3, 3], np.array([s.center_mm for s in cell.still]))
    assert found.rotation is not None
    tool = np.eye(4)
    tool[:3, :3], tool[:3, 3] = found.rotation, found.translation
    return tool


def by_board(cell: PaperCell) -> np.ndarray:
    """AX = XB (Park and Martin) of a board at the same poses."""
    told, boards = [s.told for s in cell.still], [s.board for s in cell.still]
    rotation, place = cv2.calibrateHandEye(
        [p[:3, :3] for p in told], [p[:3, 3] for p in told],
        [b[:3, :3] for b in boards], [b[:3, 3] for b in boards], method=cv2.CALIB_HAND_EYE_PARK,
    )  # fmt: skip
    tool = np.eye(4)
    tool[:3, :3], tool[:3, 3] = rotation, place.ravel()
    return tool


def circles(cell: PaperCell, tool: np.ndarray, heights: int) -> Axis:
    """The paper's axis: through the middles of the circles, across the plane of one."""
    some = [s for s in cell.table if s.mount < heights]
    centers = np.array([(s.told @ tool @ [*s.center_mm, 1.0])[:3] for s in some])
    found = paper_axis(centers, np.array([s.mount for s in some]), np.ones(len(some), bool))
    assert found.direction is not None
    assert found.point is not None
    up = found.direction * np.sign(found.direction @ cell.axis_direction)
    return found.point, up


def solved(cell: PaperCell, stage: str, arm_known: bool = False, tool: np.ndarray | None = None) -> Answer:
    record = cell.record(arm_known)
    if tool is not None:
        record["cell"]["known"] = {"tool0_from_laser": tool.tolist()}
    session = parse_session(record, "session")
    result = solve_stage(session, stage, lambda _name: b"")
    assert isinstance(result, TcpResult | TurntableResult | ChainResult)
    found = tool if tool is not None else np.array(result.tool0_from_laser)
    poses = [s.told for s in cell.scans]
    if isinstance(result, TcpResult):
        return Answer(found, (np.zeros(3), np.zeros(3)), poses)
    axis = np.array(result.axis_point_in_base_mm), np.array(result.axis_direction_in_base)
    model, arm = getattr(result, "arm_model", None), session.cell.robot.arm
    if arm_known and model is not None and model.applied and arm is not None and not isinstance(arm, str):
        moves = arm_moves(arm, [np.rad2deg(s.joints_rad).tolist() for s in cell.scans])
        told = [RigidTransform.of(p[:3, :3], p[:3, 3], "base", "tool0") for p in poses]
        poses = [corrected_by(session.cell, model, p, m).matrix for p, m in zip(told, moves, strict=True)]
    return Answer(found, axis, poses)


def with_circles(cell: PaperCell, tool: np.ndarray, heights: int) -> Answer:
    return Answer(tool, circles(cell, tool, heights), [s.told for s in cell.scans])


def jointly(cell: PaperCell) -> Answer:
    return solved(cell, "turntable", tool=solved(cell, "tcp").tool)


WAYS = {
    "two steps by positions, two heights": lambda cell: with_circles(cell, by_positions(cell), 2),
    "two steps by differences, one height": lambda cell: with_circles(cell, by_differences(cell), 1),
    "two steps by differences, two heights": lambda cell: with_circles(cell, by_differences(cell), 2),
    "a board's AX=XB, two heights": lambda cell: with_circles(cell, by_board(cell), 2),
    "joint, tool then table": jointly,
    "whole chain": lambda cell: solved(cell, "chain"),
    "whole chain, the arm known": lambda cell: solved(cell, "chain", arm_known=True),
}


def merged(scans: list[Shot], answer: Answer) -> np.ndarray:
    """All scans' points in base at the table's zero."""
    point, direction = answer.axis
    parts = []
    for shot, told in zip(scans, answer.poses, strict=True):
        way = told @ answer.tool
        places = shot.cap_mm @ way[:3, :3].T + way[:3, 3]
        parts.append((places - point) @ turn(-shot.angle_rad * direction).T + point)
    return np.concatenate(parts)


def spread_over_table(cell: PaperCell, answer: Answer) -> float:
    """RMS distance of the ball's centre, as each scan has it on the table, from their mean."""
    point, direction = answer.axis
    ways = [told @ answer.tool for told in answer.poses]
    places = [(way @ [*shot.center_mm, 1.0])[:3] - point for shot, way in zip(cell.scans, ways, strict=True)]
    on_table = np.array(
        [turn(-shot.angle_rad * direction) @ place for shot, place in zip(cell.scans, places, strict=True)]
    )
    return float(np.sqrt(np.mean(np.sum((on_table - on_table.mean(axis=0)) ** 2, axis=1))))


def ball_of(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre and radius by least squares of distances."""
    center, radius = points.mean(axis=0), RADIUS_MM
    for _ in range(20):
        off = points - center
        far = np.linalg.norm(off, axis=1)
        rows = np.column_stack([off / far[:, None], np.ones(len(far))])
        step = np.linalg.lstsq(rows, far - radius, rcond=None)[0]
        center, radius = center + step[:3], radius + float(step[3])
    return center, radius


def errors_of(cell: PaperCell, answer: Answer) -> list[float]:
    """Tool (deg, mm), axis (deg), the ball's diameter and centre, the deviation, the spread over the table."""
    turned = answer.tool[:3, :3].T @ cell.tool[:3, :3]
    angle = float(np.rad2deg(np.arccos(np.clip((np.trace(turned) - 1) / 2, -1, 1))))
    axis = float(np.rad2deg(np.linalg.norm(np.cross(answer.axis[1], cell.axis_direction))))
    points = merged(cell.scans, answer)
    center, radius = ball_of(points)
    there = cell.axis_point_mm + cell.on_table_mm[0]
    deviation = float(np.sqrt(np.mean((np.linalg.norm(points - center, axis=1) - RADIUS_MM) ** 2)))
    place = float(np.linalg.norm(answer.tool[:3, 3] - cell.tool[:3, 3]))
    return [
        angle, place, axis, 2 * (radius - RADIUS_MM), float(np.linalg.norm(center - there)), deviation,
        spread_over_table(cell, answer),
    ]  # fmt: skip


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes 10 cells."""
    seeds = 10 if full else 3
    rows: list[Row] = []
    found: dict[tuple[Errors, str], np.ndarray] = {}
    kinds: dict[Errors, str] = {"arm": f"arm's errors, {seeds} cells", "white": f"chance errors, {seeds} cells"}
    for errors, said in kinds.items():
        cells = [simulate(seed, errors) for seed in range(seeds)]
        for name, way in WAYS.items():
            if errors == "white" and name.endswith("known"):
                continue
            rms = np.sqrt(np.mean(np.square([errors_of(cell, way(cell)) for cell in cells]), axis=0))
            found[errors, name] = rms
            figure = f"{rms[0]:.3f}°, {rms[1]:.2f} mm; {rms[2]:.3f}°; {rms[3]:.2f}, {rms[4]:.2f}; {rms[5]:.2f} mm"
            what = f"{said}: {name}: tool; axis; diameter, centre; deviation"
            rows.append(Row(what, "–", figure))
    spread = float(found["arm", "whole chain, the arm known"][6] / found["arm", "whole chain"][6])
    rows.append(
        Row(
            f"{kinds['arm']}: spread of the ball over the table, the arm known / whole chain",
            "≤ 0.6",
            f"{spread:.2f} ×",
            spread <= 0.6,
        )
    )
    by, differences, whole = (
        "two steps by positions, two heights", "two steps by differences, two heights", "whole chain"
    )  # fmt: skip
    for errors, said in kinds.items():
        ratio = found[errors, differences][:2] / found[errors, by][:2]
        rows.append(
            Row(f"{said}: tool by differences / by positions, turn; place", "–", f"{ratio[0]:.2f}; {ratio[1]:.2f}")
        )
        gain = found[errors, differences][5] / found[errors, whole][5]
        rows.append(
            Row(f"{said}: deviation, the paper's way / whole chain", "≥ 1", f"{gain:.2f} ×", bool(gain >= 1))
        )
    return rows
