"""What differs between two results of a stage, of one session or of two: inputs, frames, figures, residuals."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal, cast

import numpy as np
from pydantic import Field

from calib_core.cell.found import SCANNER_FRAMES
from calib_core.estimation import chance_of
from calib_core.exports.workpiece import covariance_in, point_jacobian, seen_in_laser_mm
from calib_core.frames import FloatArray, Frame, RigidTransform
from calib_core.graph.registry import STAGES
from calib_core.records import Capture, Record, Session
from calib_core.records.evidence import Plot

_ROWS: Final = ("mahalanobis", "center_distance_mm", "surface_rms_mm", "rms_px", "line_rms_mm", "radial_mm")
_RANK: Final = (
    1e-9  # of the largest eigenvalue: a table's frame has five degrees of freedom, its covariance rank 5
)


class Side(Record):
    """One of the two results: where it comes from, and what it was computed by."""

    session: str
    name: str = ""
    number: int | None = None
    created: str | None = None
    verdict: str
    method: str
    software: str
    inputs_sha256: str


class Change(Record):
    """One thing that was changed between the inputs: `what` is a capture, or a field of the cell."""

    kind: Literal["cell", "added", "removed", "left-out", "taken-back", "changed", "file"]
    what: str
    left: str = ""
    right: str = ""


class AxisDifference(Record):
    """Right minus left along one of the six axes rx ry rz tx ty tz, in its unit, and in combined sigmas."""

    axis: str
    unit: Literal["deg", "mm"]
    difference: float
    sigma: float
    sigmas: float | None


class FrameDifference(Record):
    """How far two frames lie apart.

    `distance` is the Mahalanobis distance of the six numbers, `degrees_of_freedom` of its square, and `chance` how
    often an equal or larger one happens where both are right. `at_workpiece_mm` is how far apart the two put one
    point, `point_mm` in the frame's outer system, with the standard deviation of that.
    """

    frame: str
    angle_deg: float
    shift_mm: float
    axes: list[AxisDifference]
    distance: float
    degrees_of_freedom: int
    chance: float
    point_mm: list[float]
    at_workpiece_mm: float
    at_workpiece_sigma_mm: float


class FigureDifference(Record):
    """A single number of both results."""

    name: str
    left: float | None
    right: float | None


class RowDifference(Record):
    """A capture in both results; what is null is not in one of them."""

    capture: str
    left_used: bool | None = None
    right_used: bool | None = None
    left_reason: str | None = None
    right_reason: str | None = None
    left: dict[str, float | None] = Field(default_factory=dict)
    right: dict[str, float | None] = Field(default_factory=dict)


class Comparison(Record):
    """Two results of one stage, side by side.

    `shared` counts the captures that both used; where there are some the two are not independent, and the combined
    sigma, root of the sum of both variances, is larger than that of their difference. `changes` is null where it
    is not known what one of them was solved from. `maps` draw how far two cameras lie apart over the image.
    """

    stage: str
    left: Side
    right: Side
    shared: int
    changes: list[Change] | None
    frames: list[FrameDifference]
    figures: list[FigureDifference]
    residuals: list[RowDifference]
    maps: list[Plot] = Field(default_factory=list[Plot])


@dataclass(frozen=True)
class Compared:
    """One of two results to compare.

    Parameters
    ----------
    id : str
        Of the session.
    record : mapping
        The result as JSON data.
    session : Session
        What it was solved from; the session as it is now where that is not known.
    files : mapping or None
        The SHA-256 of its files by name; None where it is not known what it was solved from.
    number, created : optional
        Which result of the session it is, and when it came.
    """

    id: str
    record: Mapping[str, Any]
    session: Session
    files: Mapping[str, str] | None = None
    number: int | None = None
    created: str | None = None

    def side(self) -> Side:
        """Return what is said of it beside its numbers."""
        about = {name: self.record[name] for name in ("verdict", "method", "software", "inputs_sha256")}
        return Side(session=self.id, name=self.session.name, number=self.number, created=self.created, **about)


def compare_results(left: Compared, right: Compared) -> Comparison:
    """Return two results of one stage side by side.

    Raises
    ------
    InputError
        If a frame or a covariance of one of them is none.
    """
    known = None
    if left.files is not None and right.files is not None:
        known = changes(left.session, right.session, (left.files, right.files))
    return Comparison(
        stage=left.record["stage"],
        left=left.side(),
        right=right.side(),
        shared=_shared(left, right),
        changes=known,
        frames=[*_frame_differences(left, right)],
        figures=[*_figure_differences(left.record, right.record)],
        residuals=_row_differences(left.record, right.record),
        maps=STAGES.get(left.record["stage"]).difference(left.record, right.record),
    )


def _shared(left: Compared, right: Compared) -> int:
    """Return how many captures both used: those of one session, by their names."""
    if left.id != right.id:
        return 0
    used = [{row["capture"] for row in one.record["residuals"] if row["used"]} for one in (left, right)]
    return len(used[0] & used[1])


def changes(
    left: Session, right: Session, files: tuple[Mapping[str, str], Mapping[str, str]] = ({}, {})
) -> list[Change]:
    """Return what was changed from one state of a session to another.

    Parameters
    ----------
    left, right : Session
    files : tuple of mapping
        The SHA-256 of the files of either, by name, as far as known.
    """
    found = [
        Change(kind="cell", what=path, left=_words(a), right=_words(b))
        for path, a, b in _fields(left.cell.to_json(), right.cell.to_json())
    ]
    before, after = ({c.id: c for c in session.captures} for session in (left, right))
    found += [Change(kind="removed", what=name) for name in before if name not in after]
    found += [Change(kind="added", what=name) for name in after if name not in before]
    for name in before.keys() & after.keys():
        found += _capture_changes(before[name], after[name], files)
    order = {name: k for k, name in enumerate(dict.fromkeys([*before, *after]))}
    return sorted(found, key=lambda change: (change.kind != "cell", order.get(change.what.split(" ")[0], 0)))


def _capture_changes(
    before: Capture, after: Capture, files: tuple[Mapping[str, str], Mapping[str, str]]
) -> Iterator[Change]:
    told = {"excluded", "added_because", "changed_because"}
    if before.excluded != after.excluded:
        told |= {"excluded_because", "included_because"}
        yield Change(kind="left-out" if after.excluded else "taken-back", what=before.id)
    for path, a, b in _fields(before.to_json(), after.to_json()):
        if path.partition(".")[0] not in told:
            yield Change(kind="changed", what=f"{before.id} {path}", left=_words(a), right=_words(b))
    for name in before.files:
        digests = files[0].get(name), files[1].get(name)
        if None not in digests and digests[0] != digests[1]:
            yield Change(
                kind="file", what=f"{before.id} {name}", left=str(digests[0])[:12], right=str(digests[1])[:12]
            )


def _fields(left: Mapping[str, Any], right: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any, Any]]:
    for name in [*left, *(name for name in right if name not in left)]:
        a, b = left.get(name), right.get(name)
        if isinstance(a, Mapping) and isinstance(b, Mapping):
            yield from _fields(cast("Mapping[str, Any]", a), cast("Mapping[str, Any]", b), f"{path}{name}.")
        elif a != b:
            yield f"{path}{name}", a, b


def _words(value: Any) -> str:
    if value is None:
        return "–"
    text = " ".join(f"{v}" for v in cast("list[Any]", value)) if isinstance(value, list) else str(value)
    return text if len(text) <= 200 else f"{text[:199]}…"


def frames_of(stage: str) -> Iterator[tuple[str, Frame, Frame, str]]:
    """Give the frames in a stage's result, and the field of each one's covariance."""
    entry = STAGES.get(stage, "stage")
    for name, covariance in () if entry.is_second_opinion else entry.frames.items():
        into, _, outof = name.partition("_from_")
        yield name, cast(Frame, into), cast(Frame, outof), covariance


def _is_placed(one: Compared, name: str) -> bool:
    return one.record.get(name) is not None and not one.record.get("up_to_shift")


def _frame_differences(left: Compared, right: Compared) -> Iterator[FrameDifference]:
    for name, poses, known, point in shared_frames(left, right):
        yield frame_difference(name, poses, known[0] + known[1], point)


def shared_frames(
    left: Compared, right: Compared
) -> Iterator[tuple[str, tuple[RigidTransform, RigidTransform], list[FloatArray], FloatArray]]:
    """Give the frames of two results of a stage: name, poses, covariances, a point of the workpiece."""
    both = (left, right)
    for name, into, outof, covariance in frames_of(left.record["stage"]):
        if not all(_is_placed(one, name) for one in both):
            continue  # one scanner stands still, the other is on the flange; or its position is open
        first, second = (RigidTransform.from_rounded(one.record[name], into, outof) for one in both)
        points = [point for one in both if (point := workpiece_point(name, one)) is not None]
        point = np.asarray(np.mean(points, axis=0)) if points else np.zeros(3)
        yield name, (first, second), [np.asarray(covariance_in(one.record, covariance)) for one in both], point


def differences_from_truth(found: Compared, truth: Mapping[str, Any]) -> list[FrameDifference]:
    """Return how far a simulated cell's result lies from its truth, in units of its own uncertainty.

    Parameters
    ----------
    found : Compared
    truth : mapping
        The true frames by name, as `truth.json` has them.
    """
    differences: list[FrameDifference] = []
    for name, into, outof, covariance in frames_of(found.record["stage"]):
        if name not in truth or not _is_placed(found, name):
            continue
        poses = tuple(RigidTransform.from_rounded(rows[name], into, outof) for rows in (found.record, truth))
        stated = np.asarray(covariance_in(found.record, covariance))
        point = workpiece_point(name, found)
        differences.append(
            frame_difference(name, (poses[0], poses[1]), stated, np.zeros(3) if point is None else point)
        )
    return differences


def frame_difference(
    name: str, poses: tuple[RigidTransform, RigidTransform], covariance: FloatArray, point_mm: FloatArray
) -> FrameDifference:
    """Return how far the second of two poses lies from the first.

    Parameters
    ----------
    name : str
    poses : tuple of RigidTransform
    covariance : (6, 6)
        Of the difference: the sum of both poses'; rx ry rz tx ty tz, rad and mm.
    point_mm : (3,)
        The point in the outer frame at which the two are compared in mm.
    """
    left, right = poses
    difference = left.difference(right)
    squared, freedom = _mahalanobis(difference, covariance)
    apart = right.apply(point_mm) - left.apply(point_mm)
    jacobian = point_jacobian(left, point_mm)
    at_point = jacobian @ covariance @ jacobian.T
    length = float(np.linalg.norm(apart))
    # Along the difference itself; the worst direction where there is none.
    along = apart / length if length > 0 else np.linalg.eigh(at_point)[1][:, -1]
    return FrameDifference(
        frame=name,
        angle_deg=float(np.rad2deg(np.linalg.norm(difference[:3]))),
        shift_mm=float(np.linalg.norm(difference[3:])),
        axes=_axes(difference, covariance),
        distance=float(np.sqrt(squared)),
        degrees_of_freedom=freedom,
        chance=chance_of(squared, freedom) if freedom else 1.0,
        point_mm=point_mm.tolist(),
        at_workpiece_mm=length,
        at_workpiece_sigma_mm=float(np.sqrt(max(float(along @ at_point @ along), 0.0))),
    )


def _axes(difference: FloatArray, covariance: FloatArray) -> list[AxisDifference]:
    rows: list[AxisDifference] = []
    sigmas = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    for k, axis in enumerate(("rx", "ry", "rz", "x", "y", "z")):
        scale = 180 / np.pi if k < 3 else 1.0
        ratio = float(difference[k] / sigmas[k]) if sigmas[k] > 0 else None
        rows.append(
            AxisDifference(
                axis=axis,
                unit="deg" if k < 3 else "mm",
                difference=float(difference[k] * scale),
                sigma=float(sigmas[k] * scale),
                sigmas=ratio,
            )
        )
    return rows


def _mahalanobis(difference: FloatArray, covariance: FloatArray) -> tuple[float, int]:
    """Return the squared distance and its degrees of freedom; directions without variance do not count."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    some = scale > 0
    if not some.any():
        return 0.0, 0
    # Scaled to correlations, since radians and millimetres differ by orders of magnitude.
    correlation = covariance[np.ix_(some, some)] / np.outer(scale[some], scale[some])
    values, vectors = np.linalg.eigh(correlation)
    kept = values > _RANK * values[-1]
    along = vectors[:, kept].T @ (difference[some] / scale[some])
    return float(np.sum(along**2 / values[kept])), int(kept.sum())


def workpiece_point(frame: str, one: Compared) -> FloatArray | None:
    """Return the point of the workpiece (3,), mm, in a frame of a result; None where it has none there."""
    if frame in SCANNER_FRAMES:
        return seen_in_laser_mm(one.session, one.record)
    if frame == "base_from_turntable":
        mounts = [mount["center_in_turntable_mm"] for mount in one.record["mounts"]]
        return np.mean(np.array(mounts, dtype=float), axis=0) if mounts else None
    return None


def _figure_differences(left: Mapping[str, Any], right: Mapping[str, Any]) -> Iterator[FigureDifference]:
    for name in [*left, *(name for name in right if name not in left)]:
        values = [result.get(name) for result in (left, right)]
        numbers = [float(v) if isinstance(v, int | float) and not isinstance(v, bool) else None for v in values]
        if any(number is not None for number in numbers):
            yield FigureDifference(name=name, left=numbers[0], right=numbers[1])


def _row_differences(left: Mapping[str, Any], right: Mapping[str, Any]) -> list[RowDifference]:
    by_capture = [{row["capture"]: row for row in result["residuals"]} for result in (left, right)]
    rows: list[RowDifference] = []
    for capture in dict.fromkeys([*by_capture[0], *by_capture[1]]):
        a, b = (rows_of.get(capture) for rows_of in by_capture)
        rows.append(
            RowDifference(
                capture=capture,
                left_used=a and a["used"],
                right_used=b and b["used"],
                left_reason=a and a.get("reason"),
                right_reason=b and b.get("reason"),
                left=_row_figures(a),
                right=_row_figures(b),
            )
        )
    return rows


def _row_figures(row: Mapping[str, Any] | None) -> dict[str, float | None]:
    return {name: row[name] for name in _ROWS if name in row} if row else {}
