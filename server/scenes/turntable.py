"""A cell's axes as a scene shows them: their lines, the frame under the object, where the sphere stood."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.captures.placement import PlacedAxis
from calib_core.cell.axes import TABLE, reading_words, readings
from calib_core.cell.found import axis_of_table, placed_table
from calib_core.cell.titles import axis_title
from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import message
from calib_core.records import Result, Session
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.turntable.record import TableCircle, TurntableResidual, TurntableResult
from calib_core.steps import table_stages


@dataclass(frozen=True, eq=False)
class SpherePlace:
    """Where one capture saw the sphere's centre, in the base, what was read of the axes, and whether it counts."""

    capture: str
    mount: str
    read: str
    center_in_base_mm: FloatArray
    used: bool
    reason: str


@dataclass(frozen=True, eq=False)
class AxisLine:
    """An axis beside the one whose frame is known: its name, whether it carries the robot, its ends (2, 3)."""

    name: str
    under_robot: bool
    ends_mm: FloatArray


@dataclass(frozen=True, eq=False)
class TableFacts:
    """A solved or known axis that carries the object: the turntable, or another one.

    Attributes
    ----------
    base_from_turntable : RigidTransform
        T where all axes read zero.
    turns : float
        How far it turns about T's z for each unit that the encoder reads, its sense in the sign.
    mounts : mapping of name to (3,)
        Where each mounting put the sphere's centre, in T, mm.
    circles : tuple of TableCircle
        By the paper's method.
    places : tuple of SpherePlace
    slides : bool
        Whether it is a linear axis: nothing goes in circles about it.
    axis, title : str
        Its name in the cell, and what it is called.
    """

    base_from_turntable: RigidTransform
    turns: float = 1.0
    mounts: Mapping[str, FloatArray] | None = None
    circles: tuple[TableCircle, ...] = ()
    places: tuple[SpherePlace, ...] = ()
    slides: bool = False
    axis: str = TABLE
    title: str = message("Turntable")

    @property
    def zero(self) -> str:
        """What it reads at its zero, with the unit."""
        return "0\u202fmm" if self.slides else "0°"

    def turned(self, table_deg: float) -> RigidTransform:
        """Return where the table's frame is when its encoder reads an angle."""
        angle = [0.0, 0.0, self.turns * float(np.deg2rad(table_deg))]
        return self.base_from_turntable @ RigidTransform.of(angle, [0.0, 0.0, 0.0], "turntable", "turntable")

    def center_in_base_mm(self, mount: str, table_deg: float) -> FloatArray | None:
        """Return where a mounting's sphere stands at an angle (3,), None for an unknown mounting."""
        place = (self.mounts or {}).get(mount)
        return None if place is None else self.turned(table_deg).apply(place)

    def held_by(self, mount: str) -> dict[str, FloatArray]:
        """Return the sphere of a mounting, or all of a plate that is mounted so, by name, in T."""
        mounts = self.mounts or {}
        own = mounts.get(mount)
        stem = f"{mount or 'sphere'}-"
        return {mount: own} if own is not None else {n: at for n, at in mounts.items() if n.startswith(stem)}

    def mount_number(self, mount: str) -> int:
        """Return a mounting's place in the order of the result."""
        names = list(self.mounts or {})
        return names.index(mount) if mount in names else len(names)

    @property
    def reach_mm(self) -> tuple[float, float, float]:
        """How far the table's things reach: lowest and highest along the axis, and away from it."""
        places = np.array([[0.0, 0.0, 0.0], *(self.mounts or {}).values()])
        away = float(np.hypot(places[:, 0], places[:, 1]).max()) or 100.0
        return float(places[:, 2].min()), float(places[:, 2].max()), away


def table_facts(session: Session, results: Mapping[str, Result]) -> TableFacts | None:
    """Return the turntable, by the whole chain where that was solved; None where there is none."""
    for stage in table_stages():
        result = results.get(stage)
        if isinstance(result, ChainResult | TurntableResult):
            return _solved(result, {one.id: reading_words(session.cell, one) for one in session.captures})
    known = session.cell.known.base_from_turntable
    if known is None:
        return None
    pose = RigidTransform.from_rounded(known, "base", "turntable")
    return TableFacts(pose, float(session.cell.turntable.direction or 1))


def other_axes(session: Session, axes: Sequence[PlacedAxis], table: TableFacts | None) -> tuple[AxisLine, ...]:
    """Return the axes beside the table, each as far as it moved."""
    moved = [readings(capture) for capture in session.captures]
    others = [axis for axis in axes if table is None or axis.edge.name != table.axis]
    return tuple(AxisLine(one.edge.name, one.edge.under_robot, _ends_mm(one, moved, table)) for one in others)


def _ends_mm(axis: PlacedAxis, moved: Sequence[Mapping[str, float]], table: TableFacts | None) -> FloatArray:
    """Return the ends (2, 3) of an axis's line: as far as it slid; a rotary one's as long as the table is wide."""
    name, place = axis.edge.name, axis.base_from_axis
    along = place.rotation[:, 2]
    about = np.zeros(3) if table is None or axis.edge.under_robot else table.base_from_turntable.translation_mm
    if axis.edge.slides:
        read = [where[name] for where in moved if name in where] or [0.0]
        return about + axis.turns * np.array([[min(0.0, *read)], [max(0.0, *read)]]) * along
    middle = place.translation_mm + along * float((about - place.translation_mm) @ along)
    half = 1.5 * max(100.0 if table is None else table.reach_mm[2], 60.0)
    return middle + np.array([[-half], [half]]) * along


def _solved(result: ChainResult | TurntableResult, read: Mapping[str, str]) -> TableFacts:
    scale = 1.0 + result.encoder_scale.error if result.encoder_scale.applied else 1.0
    rows = [row for row in result.residuals if isinstance(row, TurntableResidual)]
    axis, kind = axis_of_table(result.model_dump(by_alias=True, include={"frames", "spheres", "axes"}))
    return TableFacts(
        placed_table(result.model_dump()),
        result.direction * scale,
        {mount.mount: np.array(mount.center_in_turntable_mm) for mount in result.mounts},
        tuple(result.circles),
        tuple(
            SpherePlace(
                row.capture,
                row.mount or "",
                read.get(row.capture, ""),
                np.array(row.center_in_base_mm),
                row.used,
                row.reason or "",
            )
            for row in rows
            if row.center_in_base_mm is not None
        ),
        result.reading_sigma_mm is not None,
        axis,
        axis_title(axis, kind),
    )
