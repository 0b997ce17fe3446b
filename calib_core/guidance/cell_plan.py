"""Before anything is bought or mounted: what a scanner, an arm and a sphere can reach at the part, and how."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from calib_core.captures.content import sphere_of
from calib_core.cell.axes import moved_axes
from calib_core.cell.carriers import ball_on_flange
from calib_core.cell.described import cell_of
from calib_core.cell.layout import MovedAxis
from calib_core.chain.chain_data import Sigmas
from calib_core.errors import InputError
from calib_core.evidence.numbers import COVERAGE
from calib_core.frames import RigidTransform, rotation_from_vector
from calib_core.guidance.arm_plan import ArmWorth, arm_worth
from calib_core.guidance.candidates import Room
from calib_core.guidance.described import CellThoughtOf, thought_of
from calib_core.guidance.design import Assumed, Design, worst_sigma
from calib_core.guidance.edges_plan import EdgesPlan, plan_edges
from calib_core.guidance.field_of_view import Sight
from calib_core.guidance.planner import Situation, greedy
from calib_core.guidance.table_plan import TablePlan, TableToPlan, plan_table
from calib_core.messages import message, templates
from calib_core.records import Cell, NotNegative, Positive, Record
from calib_core.records.described import DescribedEdges
from calib_core.records.planning import FieldOfView, Limits
from calib_core.records.session import SphereClass

ArmClass = Literal["calibrated", "ordinary", "nominal"]

ARMS: Final[Mapping[str, Sigmas]] = {
    "calibrated": Sigmas(0.02, 5e-5, (5e-5,), 0.02, 5e-5, 1.0),
    "ordinary": Sigmas(0.05, 1.5e-4, (1e-4,), 0.06, 1.5e-4, 1.0),
    "nominal": Sigmas(0.08, 2e-4, (1e-4,), 0.2, 3e-4, 1.0),
}
"""A pose's own scatter and the part that is alike where poses are alike: of an arm whose kinematics were
measured, of a good one, and of a large one as delivered."""

_DIAMETERS_MM: Final = (12.0, 20.0, 25.4, 30.0, 38.1, 50.0, 60.0, 80.0)
_MOST_CAPTURES: Final = 30
_GRID: Final = 160
_LEAST_BESIDE: Final = 8  # captures beside the table, before those on it
_TILT_DEG: Final = 30.0  # where the limits tell none
_HOME: Final = rotation_from_vector(np.array([np.pi, 0.0, 0.0]))
_READ_MM: Final = 0.03  # of a linear axis's reading
_SAME: Final = 1.02  # nearer to each other than this two spheres are alike, and the smaller one is proposed


class CellToPlan(DescribedEdges):
    """A cell that does not stand yet; lengths in mm. What is left out is an ordinary one's.

    `scanners`, `spheres`, `axes`, `arrangement` and `machine` are the edges of another cell than the plain one.

    `arm_name` is that of a known arm: the plan then says what its own errors, solved with joints, are worth.
    `mounting_mm` is about how far the scanner sits from the flange; without `sphere_diameter_mm` the usual ones
    are tried.
    """

    scanner: FieldOfView
    point_sigma_mm: Positive = 0.02
    pitch_mm: Positive = 0.1
    kind: Literal["profile", "cloud", "center"] = "profile"
    arm: ArmClass = "ordinary"
    arm_name: str | None = None
    position_sigma_mm: NotNegative | None = None
    mounting_mm: Positive = 150.0
    sphere_diameter_mm: Positive | None = None
    sphere_class: SphereClass = "certified"
    limits: Limits = Field(default_factory=Limits)
    wanted_mm: Positive | None = None
    table: TableToPlan | None = None
    most_captures: Annotated[int, Field(ge=5, le=60)] = _MOST_CAPTURES


class SpherePlan(Record):
    """What one sphere reaches: ± (k = 2) at the workpiece after so many captures, and after how many as wanted.

    `captures` is null where `most_captures` do not reach `wanted_mm`; `after_mm` has one figure a capture, null
    while a direction is open.
    """

    diameter_mm: float
    captures: int | None
    uncertainty_mm: float
    after_mm: list[float | None]


class CellPlan(Record):
    """What is reachable, with which sphere, how many captures, and where to put it.

    `spheres` are those that fit into the field, as they were tried. `sphere` is the one to take. `distance_mm` and
    `offset_mm` say how the scanner should see it: that far along z, the stripe that far beside its middle.
    `limited_by` says what more captures would not help; `table` where to put the sphere on the turntable; `edges`
    which captures tell the edges of another cell than the plain one.
    """

    reachable: bool | None
    wanted_mm: float | None
    sphere: SpherePlan
    spheres: list[SpherePlan]
    distance_mm: float
    offset_mm: float
    where: str
    limited_by: str
    sentence: str
    table: TablePlan | None = None
    edges: EdgesPlan | None = None
    arm_errors: list[ArmWorth] = Field(default_factory=list[ArmWorth])
    arm_sentence: str = ""


def plan_cell(cell: CellToPlan) -> CellPlan:
    """Return what a cell will reach, from the covariance that its solver would state.

    Raises
    ------
    InputError
        If no sphere fits into the field of view.
    """
    told = cell_of(cell, pose_convention="matrix", limits=cell.limits) if cell.has_edges else None
    diameters = _DIAMETERS_MM if cell.sphere_diameter_mm is None else (cell.sphere_diameter_mm,)
    tried = [found for diameter in diameters if (found := _with_sphere(cell, diameter)) is not None]
    if not tried:
        field = cell.scanner
        got = message(
            "{near_width_mm:g} mm at {near_mm:g} mm, {far_mm:g} mm deep",
            near_width_mm=field.near_width_mm,
            near_mm=field.near_mm,
            far_mm=field.far_mm - field.near_mm,
        )
        to_do = message("Take a smaller sphere, or a scanner with a larger field.")
        raise InputError("a field of view into which the sphere's arc fits", got, to_do, "scanner")
    plan, situation = min(tried, key=lambda one: (_cost(one[0]), one[0].diameter_mm))
    sight, radius = situation.room.sight, plan.diameter_mm / 2
    distance, offset = float(abs(sight.safest(radius, 1.0)[2])), 0.55 * radius if cell.kind == "profile" else 0.0
    reached = None if cell.wanted_mm is None else plan.captures is not None
    table = None
    if cell.table is not None:
        seen = situation.seen_from(situation.proposed(_GRID))
        order = greedy(Design(seen, situation.assumed), [], _taken(cell, plan))
        table = plan_table(cell.table, replace(situation, taken=[seen[k] for k in order]), cell.wanted_mm)
        if table is None:
            to_do = message("Widen `limits`: the scanner must see the sphere all around the table.")
            raise InputError("poses all around the table", "none that the limits allow", to_do, "limits")
        reached = None if reached is None else reached and bool(table.reachable)
    edges = None
    if told is not None:
        edges = plan_edges(_thought_of(cell, told, situation), cell.wanted_mm, cell.most_captures)
        reached = edges.reachable
    worth = _arm_errors(cell)
    return CellPlan(
        arm_errors=worth,
        arm_sentence=_said_of_arm(worth),
        reachable=reached,
        wanted_mm=cell.wanted_mm,
        sphere=plan,
        spheres=[one for one, _ in tried],
        distance_mm=distance,
        offset_mm=offset,
        where=_where(told),
        limited_by=_limited_by(situation),
        table=table,
        edges=edges,
        sentence=_sentence(cell, plan),
    )


def _where(told: Cell | None) -> str:
    """Return where to put the sphere; of a cell of edges, as its captures have it."""
    if told is None:
        return message(
            "Where the workpiece will be, at its height: the arm's errors are alike there and count for both. "
            "On a table: once beside it, then on it, as far off the axis as the workpiece reaches, at its lowest "
            "and at its highest, eight angles each."
        )
    if ball_on_flange(told):
        return message("On the flange, where the workpiece will be held: the arm's errors are alike there.")
    return message("Where the workpiece will be: the arm's errors are alike there. Balls on axes stand below.")


def _thought_of(cell: CellToPlan, told: Cell, situation: Situation) -> CellThoughtOf:
    """Return the described cell with the sphere that was chosen."""
    given = situation.assumed
    axes = [_reading_sigma(axis, given.sigmas.angle_rad) for axis in moved_axes(told)]
    sigmas = replace(given.sigmas, axes=tuple(axes))
    return thought_of(cell, told, situation.room.sight, given.sphere, sigmas)


def _reading_sigma(axis: MovedAxis, angle_rad: float) -> float:
    return angle_rad if axis.kind == "rotary" else _READ_MM


def _arm_errors(cell: CellToPlan) -> list[ArmWorth]:
    """Return what the arm's own errors are worth; nothing where they were measured, or the arm is not named."""
    if cell.arm_name is None or cell.arm == "calibrated":
        return []
    from calib_core.arms.kinematics import arm_of

    own_mm = ARMS[cell.arm].position_mm if cell.position_sigma_mm is None else cell.position_sigma_mm
    return arm_worth(arm_of(cell.arm_name), own_mm, cell.limits.tilt_deg or _TILT_DEG)


def _said_of_arm(worth: list[ArmWorth]) -> str:
    first = next((one for one in worth if one.worth_it), None)
    if not worth:
        return ""
    if first is None:
        return message(
            "The arm's own errors are not worth solving with {count} captures.", count=worth[-1].captures
        )
    return message(
        "With joints told, the arm's own errors are worth solving from {captures} captures on: points measured "
        "from other poses then agree to {with_mm:.2f} mm instead of {without_mm:.2f} mm, with {most} captures to "
        "{best_mm:.2f} mm (RMS, an ordinary arm of its size).",
        captures=first.captures,
        with_mm=first.with_mm,
        without_mm=first.without_mm,
        most=worth[-1].captures,
        best_mm=worth[-1].with_mm,
    )


def _with_sphere(cell: CellToPlan, diameter_mm: float) -> tuple[SpherePlan, Situation] | None:
    """Return what captures of a sphere reach, each the one that helps most; None where it does not fit."""
    situation = _situation(cell, diameter_mm)
    poses = situation.proposed(_GRID)
    if len(poses) < cell.most_captures:
        return None
    design = Design(situation.seen_from(poses), situation.assumed)
    order = greedy(design, [], cell.most_captures)
    after = [float(worst_sigma(design.workpiece(order[: n + 1]))) for n in range(len(order))]
    wanted = cell.wanted_mm
    captures = next((n + 1 for n, s in enumerate(after) if wanted is not None and COVERAGE * s <= wanted), None)
    shown = [COVERAGE * s if s < 20.0 else None for s in after]
    plan = SpherePlan(
        diameter_mm=diameter_mm, captures=captures, uncertainty_mm=COVERAGE * after[-1], after_mm=shown
    )
    return plan, situation


def _situation(cell: CellToPlan, diameter_mm: float) -> Situation:
    field = cell.scanner
    sight = Sight(
        kind=cell.kind,
        near_mm=field.near_mm,
        far_mm=field.far_mm,
        near_half_width_mm=field.near_width_mm / 2,
        far_half_width_mm=(field.far_width_mm or field.near_width_mm) / 2,
        pitch_mm=cell.pitch_mm,
        point_sigma_mm=cell.point_sigma_mm,
    )
    sigmas = ARMS[cell.arm]
    if cell.position_sigma_mm is not None:
        sigmas = replace(sigmas, position_mm=cell.position_sigma_mm)
    as_told = Cell(pose_convention="matrix", sphere_diameter_mm=diameter_mm, sphere_class=cell.sphere_class)
    aside = cell.mounting_mm / np.sqrt(2)
    tool = RigidTransform.of([0.3, 0.0, 0.0], [aside, 0.0, aside], "tool0", "laser")
    center = np.array([1000.0, 0.0, 500.0])
    assumed = Assumed(sphere_of(as_told, []), tool, center, sigmas, sight.middle_mm)
    return Situation([], assumed, Room(sight, cell.limits, _HOME))


def _taken(cell: CellToPlan, plan: SpherePlan) -> int:
    """Return how many captures beside the table come before those on it."""
    return max(plan.captures or cell.most_captures, _LEAST_BESIDE)


def _cost(plan: SpherePlan) -> float:
    """Return what decides between spheres: captures as wanted, else ±, in steps of `_SAME`."""
    if plan.captures is not None:
        return float(plan.captures)
    return 1000.0 + np.round(np.log(plan.uncertainty_mm) / np.log(_SAME))


def _limited_by(situation: Situation) -> str:
    """Return what is left however many captures there are: the source without which the same captures do best."""
    poses = situation.proposed(60)
    seen, given = situation.seen_from(poses), situation.assumed
    every = range(len(seen))
    exact = replace(given.sphere, sigma_mm=0.0)
    own = replace(given.sigmas, position_mm=0.002, orientation_rad=2e-6)
    alike = replace(given.sigmas, alike_position_mm=0.0, alike_orientation_rad=0.0)
    without = {
        "the sphere's diameter: take one with a certificate": replace(given, sphere=exact),
        "the arm's repeatability": replace(given, sigmas=own),
        "the arm's errors that are alike where poses are alike: have its kinematics measured": replace(
            given, sigmas=alike
        ),
        "what is not known of the scanner's scale, and of the arm's lengths with it": replace(given, priors=None),
    }
    left = {cause: float(worst_sigma(Design(seen, one).workpiece(every))) for cause, one in without.items()}
    return min(left, key=lambda cause: left[cause])


_SPHERE: Final[dict[SphereClass, str]] = templates({
    "certified": "a certified sphere of {diameter_mm:g} mm",
    "bearing": "a bearing ball of {diameter_mm:g} mm",
    "coated": "a coated sphere of {diameter_mm:g} mm",
    "turned": "a turned sphere of {diameter_mm:g} mm",
})  # fmt: skip


def _sentence(cell: CellToPlan, plan: SpherePlan) -> str:
    sphere = message(_SPHERE[cell.sphere_class], diameter_mm=plan.diameter_mm)
    if cell.wanted_mm is None:
        return message(
            "± {uncertainty_mm:.2g} mm at the workpiece with {sphere} and {count} captures.",
            uncertainty_mm=plan.uncertainty_mm,
            sphere=sphere,
            count=len(plan.after_mm),
        )
    if plan.captures is None:
        return message(
            "± {wanted_mm:g} mm is out of reach: {sphere} and {count} captures leave ± {uncertainty_mm:.2g} mm.",
            wanted_mm=cell.wanted_mm,
            sphere=sphere,
            count=len(plan.after_mm),
            uncertainty_mm=plan.uncertainty_mm,
        )
    return message(
        "± {wanted_mm:g} mm at the workpiece takes {sphere} and {captures} captures.",
        wanted_mm=cell.wanted_mm,
        sphere=sphere,
        captures=plan.captures,
    )
