"""The turntable as a scene shows it: its axis and frame, where the sphere stood at each angle, how it turns."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib_core.cell.found import placed_table
from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import Capture, Result, Session
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
class TableFacts:
    """A solved or known turntable.

    Attributes
    ----------
    base_from_turntable : RigidTransform
        T at the table's angle zero.
    turns : float
        How far it turns about T's z for each unit that the encoder reads, its sense in the sign.
    mounts : mapping of name to (3,)
        Where each mounting put the sphere's centre, in T, mm.
    circles : tuple of TableCircle
        By the paper's method.
    places : tuple of SpherePlace
    slides : bool
        Whether it is a linear axis: nothing goes in circles about it.
    """

    base_from_turntable: RigidTransform
    turns: float = 1.0
    mounts: Mapping[str, FloatArray] | None = None
    circles: tuple[TableCircle, ...] = ()
    places: tuple[SpherePlace, ...] = ()
    slides: bool = False

    def turned(self, table_deg: float) -> RigidTransform:
        """Return where the table's frame is when its encoder reads an angle."""
        angle = [0.0, 0.0, self.turns * float(np.deg2rad(table_deg))]
        return self.base_from_turntable @ RigidTransform.of(angle, [0.0, 0.0, 0.0], "turntable", "turntable")

    def center_in_base_mm(self, mount: str, table_deg: float) -> FloatArray | None:
        """Return where a mounting's sphere stands at an angle (3,), None for an unknown mounting."""
        place = (self.mounts or {}).get(mount)
        return None if place is None else self.turned(table_deg).apply(place)

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
            return _solved(result, {capture.id: _read(capture) for capture in session.captures})
    known = session.cell.known.base_from_turntable
    if known is None:
        return None
    pose = RigidTransform.from_rounded(known, "base", "turntable")
    return TableFacts(pose, float(session.cell.turntable.direction or 1))


def expected_center_mm(table: TableFacts | None, capture: Capture) -> FloatArray | None:
    """Return where the solution expects the sphere of a capture of the table (3,), in the base."""
    if table is None or capture.table_deg is None:
        return None
    return table.center_in_base_mm(capture.mount or "", capture.table_deg)


def _read(capture: Capture) -> str:
    """Return what a capture read of the axes that carry the object, in words."""
    angles = [value for value in (capture.table_deg, *(capture.axes_deg or {}).values()) if value is not None]
    return ", ".join(
        [*(f"{a:g}°" for a in angles), *(f"{mm:g}\u202fmm" for mm in (capture.axes_mm or {}).values())]
    )


def _solved(result: ChainResult | TurntableResult, read: Mapping[str, str]) -> TableFacts:
    scale = 1.0 + result.encoder_scale.error if result.encoder_scale.applied else 1.0
    rows = [row for row in result.residuals if isinstance(row, TurntableResidual)]
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
    )
