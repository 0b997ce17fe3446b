"""The frames of a cell as a graph: its edges are transforms that are measured, known, solved or sought.

Two frames may lie many edges apart; the transform between them follows along the shortest way, and so does its
covariance, with what the edges of one answer share.
"""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from calib_core.errors import ConflictError, InputError
from calib_core.frames import FRAMES, FloatArray, Frame, RigidTransform, skew
from calib_core.messages import message

EdgeState = Literal["measured", "known", "solved", "sought"]


@dataclass(frozen=True, eq=False)
class FrameEdge:
    """One transform of a cell, or the place of one that is not there yet.

    Attributes
    ----------
    into, outof : Frame
    state : str
        `measured` with a capture, `known` because the user brought it, `solved` by a stage, or still `sought`.
    source : str
        The capture, the cell's field or the stage that it is of; of a sought one the stage that will find it.
    transform : RigidTransform or None
        None where it is sought, and of a measured one until a capture is chosen.
    covariance : (6, 6) or None
        Of rx ry rz tx ty tz, rad and mm; None where none is stated.
    scanner : str or None
        The scanner's name, where the cell has several.
    stale : bool
        Whether what it was solved from has changed since.
    """

    into: Frame
    outof: Frame
    state: EdgeState
    source: str
    transform: RigidTransform | None = None
    covariance: FloatArray | None = None
    scanner: str | None = None
    stale: bool = False

    @property
    def name(self) -> str:
        """Its name, `into_from_outof`."""
        return f"{self.into}_from_{self.outof}"


@dataclass(frozen=True, eq=False)
class FoundTransform:
    """A transform between two frames, and the edges that lead from the one to the other.

    Attributes
    ----------
    transform : RigidTransform
    covariance : (6, 6)
        Of rx ry rz tx ty tz, rad and mm, of all edges that state one.
    through : tuple of FrameEdge
        From `into` to `outof`.
    """

    transform: RigidTransform
    covariance: FloatArray
    through: tuple[FrameEdge, ...]

    @property
    def without_covariance(self) -> tuple[str, ...]:
        """The names of the edges whose uncertainty is not in the covariance, since nobody stated it."""
        return tuple(edge.name for edge in self.through if edge.covariance is None)


@dataclass(frozen=True, eq=False)
class FrameGraph:
    """The frames of a cell with one scanner's edges.

    Parameters
    ----------
    edges : sequence of FrameEdge
        Of several between the same frames the first one counts.
    shared : mapping
        Covariances (6, 6) of two edges that one answer gives, by their names.
    """

    edges: Sequence[FrameEdge]
    shared: Mapping[tuple[str, str], FloatArray] = field(default_factory=dict[tuple[str, str], FloatArray])

    def find(self, into: str, outof: str) -> FoundTransform:
        """Return the transform that maps points of `outof` into `into`.

        Raises
        ------
        InputError
            If a frame is unknown.
        ConflictError
            If no way leads from the one to the other, or an edge on it is still sought.
        """
        way = self._way(_known_frame(into), _known_frame(outof))
        missing = [edge for edge, _ in way if edge.transform is None]
        if missing:
            raise ConflictError(
                f"{into}_from_{outof}",
                "{missing}, which is known of each capture alone"
                if missing[0].state == "measured"
                else "{missing}, which is not determined yet",
                _to_do(missing[0]),
                missing[0].source,
                missing=missing[0].name,
            )
        return _along(way, _known_frame(into), self.shared)

    def _way(self, into: Frame, outof: Frame) -> list[tuple[FrameEdge, bool]]:
        """Return the edges from `into` to `outof` with whether each is passed against its direction.

        The shortest way without a sought edge; where there is none, the shortest.
        """
        usable = [edge for edge in self.edges if edge.transform is not None]
        for edges in (usable, self.edges):
            found = _shortest(edges, into, outof)
            if found is not None:
                return found
        linked = ", ".join(dict.fromkeys(edge.name for edge in self.edges)) or "no transform"
        need = "transforms that lead from {outof} to {into}"
        to_do = "Solve the stages between them."
        raise ConflictError(need, "{linked} alone", to_do, outof=outof, into=into, linked=linked)


def _known_frame(name: str) -> Frame:
    for frame in FRAMES:
        if frame == name:
            return frame
    raise InputError.unknown(name, FRAMES, "frame")


def _to_do(edge: FrameEdge) -> str:
    if edge.state == "measured":
        return message("Name the capture whose pose counts.")
    return message("Solve the stage '{source}', or give the transform in `cell.known`.", source=edge.source)


def _shortest(edges: Sequence[FrameEdge], into: Frame, outof: Frame) -> list[tuple[FrameEdge, bool]] | None:
    """Return the way with the fewest edges, the earlier edges first; None where there is none."""
    ways: dict[Frame, list[tuple[FrameEdge, bool]]] = {into: []}
    waiting: deque[Frame] = deque([into])
    while waiting and outof not in ways:
        frame = waiting.popleft()
        for edge, other, against in _from(edges, frame):
            if other not in ways:
                ways[other] = [*ways[frame], (edge, against)]
                waiting.append(other)
    return ways.get(outof)


def _from(edges: Sequence[FrameEdge], frame: Frame) -> Iterator[tuple[FrameEdge, Frame, bool]]:
    for edge in edges:
        if edge.into == frame:
            yield edge, edge.outof, False
        elif edge.outof == frame:
            yield edge, edge.into, True


def _along(
    way: Sequence[tuple[FrameEdge, bool]], into: Frame, shared: Mapping[tuple[str, str], FloatArray]
) -> FoundTransform:
    """Return the product of a way's transforms with the covariance of first order."""
    steps = [
        edge.transform.inverse() if against else edge.transform
        for edge, against in way
        if edge.transform is not None
    ]
    products = [RigidTransform.identity(into, into)]
    for step in steps:
        products.append(products[-1] @ step)
    total = products[-1]
    jacobians = [
        _jacobian(products[number], step, products[number + 1].inverse() @ total)
        @ (_of_inverse(step.inverse()) if against else np.eye(6))
        for number, (step, (_, against)) in enumerate(zip(steps, way, strict=True))
    ]
    covariance = np.zeros((6, 6))
    for (edge, _), jacobian in zip(way, jacobians, strict=True):
        if edge.covariance is not None:
            covariance += jacobian @ edge.covariance @ jacobian.T
    for first, (one, _) in enumerate(way):
        for second, (other, _) in enumerate(way):
            if (one.name, other.name) in shared:
                part = jacobians[first] @ shared[one.name, other.name] @ jacobians[second].T
                covariance += part + part.T
    return FoundTransform(total, (covariance + covariance.T) / 2, tuple(edge for edge, _ in way))


def apart_moves(one: RigidTransform, other: RigidTransform) -> FloatArray:
    """Return how ``one⁻¹ @ other`` changes with the 6-vectors of both, (6, 12)."""
    back, still = one.inverse(), RigidTransform.identity(other.outof, other.outof)
    by_one = _jacobian(still, back, other) @ _of_inverse(one)
    return np.hstack([by_one, _jacobian(back, other, still)])


def _jacobian(before: RigidTransform, step: RigidTransform, after: RigidTransform) -> FloatArray:
    """Return how ``before @ step @ after`` changes with the 6-vector of its middle, (6, 6).

    R·exp(r) and t + δt of the middle: the product's rotation vector is ``after⁻¹ r``, its translation moves by
    ``before (δt − R [after's t]× r)``.
    """
    result = np.zeros((6, 6))
    result[:3, :3] = after.rotation.T
    result[3:, :3] = -before.rotation @ step.rotation @ skew(after.translation_mm)
    result[3:, 3:] = before.rotation
    return result


def _of_inverse(transform: RigidTransform) -> FloatArray:
    """Return how the inverse's 6-vector changes with that of a transform, (6, 6)."""
    turned = transform.rotation.T
    result = np.zeros((6, 6))
    result[:3, :3] = -transform.rotation
    result[3:, :3] = -skew(turned @ transform.translation_mm)
    result[3:, 3:] = -turned
    return result
