"""Before a turntable is bought or mounted: where to put the sphere on it, at how many angles, what that leaves."""

from dataclasses import replace
from itertools import product
from typing import Annotated, Final

import numpy as np
from pydantic import Field

from calib_core.chain.table import TableState
from calib_core.evidence.numbers import COVERAGE
from calib_core.guidance.planner import Situation
from calib_core.guidance.table_advice import TableSituation, shots_at
from calib_core.guidance.table_design import TableDesign, TableGuess
from calib_core.messages import message
from calib_core.records import NotNegative, Positive, Record

_ANGLES: Final = (4, 6, 8, 12, 16)
_NEAR_SHARE: Final = 0.5  # of the workpiece's radius: where a table's edge or the reach leaves no more
_IN_BASE_MM: Final = (1000.0, 0.0, 400.0)


class TableToPlan(Record):
    """A turntable that does not stand yet: how far off the axis and how high the workpiece reaches, mm."""

    radius_mm: Positive = 100.0
    height_mm: NotNegative = 150.0
    angle_sigma_deg: NotNegative = 0.005
    most_angles: Annotated[int, Field(ge=4, le=16)] = 12


class TableLayout(Record):
    """One way to put the sphere on the table: off the axis, at heights, at so many angles each; the ± it leaves.

    `uncertainty_mm` (k = 2) is at the rim of the workpiece, at its foot or its top, whichever is worse.
    """

    radius_mm: float
    heights_mm: list[float]
    angles: int
    captures: int
    uncertainty_mm: float


class TablePlan(Record):
    """The layout to take, and those that were tried; `reachable` is null where no ± is wanted."""

    reachable: bool | None
    layout: TableLayout
    layouts: list[TableLayout]
    sentence: str


def plan_table(table: TableToPlan, still: Situation, wanted_mm: float | None) -> TablePlan | None:
    """Return where to put the sphere on a table, from the covariance that the whole chain would state.

    Parameters
    ----------
    table : TableToPlan
    still : Situation
        Whose `taken` are the captures beside the table.
    wanted_mm : float or None
        The wanted ± (k = 2) at the workpiece.

    Returns
    -------
    TablePlan or None
        None where the limits leave no pose all around the table.
    """
    sigmas = replace(still.assumed.sigmas, axes=(float(np.deg2rad(table.angle_sigma_deg)),))
    still = replace(still, assumed=replace(still.assumed, sigmas=sigmas))
    heights = [[0.0]] if table.height_mm == 0 else [[0.0], [0.0, table.height_mm]]
    radii = [_NEAR_SHARE * table.radius_mm, table.radius_mm]
    counts = [count for count in _ANGLES if count <= table.most_angles]
    tried = [_layout(table, still, *one) for one in product(radii, heights, counts)]
    layouts = [layout for layout in tried if layout is not None]
    if not layouts:
        return None
    enough = [one for one in layouts if wanted_mm is not None and one.uncertainty_mm <= wanted_mm]
    best = min(enough, key=lambda one: (one.captures, one.uncertainty_mm)) if enough else None
    best = best or min(layouts, key=lambda one: one.uncertainty_mm)
    reachable = None if wanted_mm is None else bool(enough)
    return TablePlan(reachable=reachable, layout=best, layouts=layouts, sentence=_sentence(best, wanted_mm))


def _layout(
    table: TableToPlan, still: Situation, radius_mm: float, heights_mm: list[float], angles: int
) -> TableLayout | None:
    names = tuple(f"h{k}" for k in range(len(heights_mm)))
    places = np.array([[radius_mm, 0.0, height] for height in heights_mm])
    guess = TableGuess(TableState(np.eye(3), np.array(_IN_BASE_MM), places), names)
    points = np.array([[table.radius_mm, 0.0, 0.0], [table.radius_mm, 0.0, table.height_mm]])
    now = TableSituation(still, guess, (), points)
    around = [360.0 * k / angles for k in range(angles)]
    shots = [one for mount in range(len(names)) for _, _, one in shots_at(now, mount, around)]
    if len(shots) < len(names) * angles:
        return None
    design = TableDesign(still.taken, shots, still.assumed, guess, points)
    return TableLayout(
        radius_mm=radius_mm,
        heights_mm=heights_mm,
        angles=angles,
        captures=len(shots),
        uncertainty_mm=COVERAGE * design.sigma_mm(range(len(shots))),
    )


def _sentence(layout: TableLayout, wanted_mm: float | None) -> str:
    at = [f"{height:.0f}" for height in layout.heights_mm]
    where = message(
        "the sphere {radius_mm:.0f} mm off the axis at {at} mm above the workpiece's foot, {angles} angles each",
        radius_mm=layout.radius_mm,
        at=at,
        angles=layout.angles,
    )
    if wanted_mm is not None and layout.uncertainty_mm > wanted_mm:
        return message(
            "± {wanted_mm:g} mm is out of reach on the table: {place} leave ± {uncertainty_mm:.2g} mm.",
            wanted_mm=wanted_mm,
            place=where,
            uncertainty_mm=layout.uncertainty_mm,
        )
    return message(
        "On the table ± {uncertainty_mm:.2g} mm at the workpiece's rim: {place}.",
        uncertainty_mm=layout.uncertainty_mm,
        place=where,
    )
