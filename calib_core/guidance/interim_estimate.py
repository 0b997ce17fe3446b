"""Tool, sphere and table as far as the captures tell them before they are solved, with their uncertainty."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from calib_core.frames import FloatArray, RigidTransform
from calib_core.guidance.advice import inputs_of, inputs_read
from calib_core.guidance.design import Design
from calib_core.guidance.prior import situation_of
from calib_core.guidance.table_advice import table_situation
from calib_core.guidance.table_design import TableDesign
from calib_core.records import Measured, ResultsData, Session
from calib_core.steps import steps_that_show


@dataclass(frozen=True, eq=False)
class KnownSoFar:
    """What the captures of the still sphere tell by now.

    Attributes
    ----------
    mount_from_laser : RigidTransform
    center_in_base_mm : (3,)
        Of the still sphere.
    tool : (6, 6)
        The covariance of mount_from_laser: rx ry rz tx ty tz, rad and mm.  It shrinks with each capture.
    center : (3, 3)
        That of the sphere's centre, mm².
    """

    mount_from_laser: RigidTransform
    center_in_base_mm: FloatArray
    tool: FloatArray
    center: FloatArray


@dataclass(frozen=True, eq=False)
class TableSoFar:
    """What the captures of the sphere on the table tell by now.

    Attributes
    ----------
    base_from_turntable : RigidTransform
        Of T by its rule, at the table's angle zero.
    covariance : (6, 6)
        Its own: rx ry rz tx ty tz, rad and mm.  It shrinks with each capture.
    direction : {1, -1}
        Whether the table turns about T's z as its angles grow, or against it.
    mounts : dict of name to (3,)
        Where each mounting put the sphere's centre, in T, mm.
    """

    base_from_turntable: RigidTransform
    covariance: FloatArray
    direction: int
    mounts: dict[str, FloatArray]


def known_so_far(session: Session, measured: Sequence[Measured], results: ResultsData) -> KnownSoFar | None:
    """Return what the TCP's captures tell by now; None where too little is known to say where the sphere is.

    Parameters
    ----------
    session : Session
    measured : sequence of Measured
    results : mapping
        From stage to the JSON data of its result; a stale one still tells about where the tool is.
    """
    return _so_far(inputs_of(session, measured, results, ("tcp",)))


@lru_cache(maxsize=64)
def _so_far(told: str) -> KnownSoFar | None:
    situation = situation_of(*inputs_read(told))
    if situation is None or not situation.taken or not situation.room.sight.carriers.scanner_moves:
        return None  # what is drawn of it stands in base
    assumed = situation.assumed
    design = Design(situation.taken, assumed)
    covariance = design.covariance(range(len(design)))
    return KnownSoFar(assumed.mount_from_laser, assumed.center_mm, covariance[:6, :6], covariance[6:9, 6:9])


def table_so_far(session: Session, measured: Sequence[Measured], results: ResultsData) -> TableSoFar | None:
    """Return what the captures on the table tell by now; None where too few tell where its axis is.

    The arguments are those of `known_so_far`.
    """
    return _table_so_far(inputs_of(session, measured, results, steps_that_show("sphere", "sphere-on-table")))


@lru_cache(maxsize=16)
def _table_so_far(told: str) -> TableSoFar | None:
    now = table_situation(*inputs_read(told))
    if now is None or not now.taken:
        return None
    design = TableDesign(now.still.taken, now.taken, now.still.assumed, now.table, now.points)
    frame = now.table.frame
    mounts = dict(zip(now.table.names, frame.mounts_mm, strict=True))
    covariance = design.pose_covariance(range(len(now.taken)))
    return TableSoFar(frame.base_from_turntable, covariance, frame.direction, mounts)
