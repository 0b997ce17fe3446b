"""What a scene is made of: a session with its results, and what gives its points, scans and advice."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from calib_core.frames import FloatArray
from calib_core.records import Capture, Measured, Result, Session
from server.scenes.deviation import ReferenceMesh
from server.scenes.merged import MergedScans

if TYPE_CHECKING:
    from calib_core.guidance.interim_estimate import KnownSoFar, TableSoFar
    from calib_core.records.base import Matrix4
    from calib_core.review.placed_points import PlacedPoint

LoadPoints = Callable[[Capture], FloatArray]


def nothing(_known: object = None) -> None:
    """Give no cloud, no scans."""


def no_points(_: Capture) -> FloatArray:
    """Give no points of a capture."""
    return np.zeros((0, 3))


@dataclass(frozen=True, eq=False)
class SceneAdvice:
    """Where the guide wants the flange next, and what the captures tell where no result does.

    Attributes
    ----------
    next_pose : rows of base_from_tool0, None where it wants it nowhere
    so_far : KnownSoFar, None before the captures tell where the sphere is
    table_so_far : TableSoFar, None before they tell the table's axis
    """

    next_pose: "Matrix4 | None" = None
    so_far: "KnownSoFar | None" = None
    table_so_far: "TableSoFar | None" = None


@dataclass(frozen=True, eq=False)
class SceneInput:
    """A session as its scene needs it.

    Attributes
    ----------
    session : Session
        The record with its captures.
    measured : sequence of Measured
        What was seen in the captures; those not measured yet are left out.
    results : mapping of stage name to Result
    load_points : callable
        Gives the points (N, 3) on the sphere of one capture, in L, mm; none when there are none.
    load_scans : callable
        Gives the scans as they were measured, those of the merge where there is one, None where there are none or
        the scanner is not known; takes a dict in which it keeps each scan from one call to the next.
    load_merged : callable
        Gives the merged cloud that was stored, None where there is none.
    load_reference : callable
        Gives the mesh that says what the object should be, None where there is none.
    outputs : tuple of str
        Says which files the three above read, so that what was read can be kept.
    stale : frozenset of str
        The stages whose results are older than the captures.
    compared : tuple of PlacedPoint
        Two answers, where the scene shows what lies between them.
    advise : callable
        Gives what takes long to work out; worked out here if left out.
    """

    session: Session
    load_points: LoadPoints
    measured: Sequence[Measured] = ()
    results: Mapping[str, Result] = field(default_factory=dict[str, Result])
    load_scans: Callable[..., MergedScans | None] = nothing
    load_merged: Callable[[], MergedScans | None] = nothing
    load_reference: Callable[[], ReferenceMesh | None] = nothing
    outputs: tuple[str, ...] = ()
    stale: frozenset[str] = frozenset()
    compared: "tuple[PlacedPoint, ...]" = ()
    advise: "Callable[[SceneInput], SceneAdvice] | None" = None
