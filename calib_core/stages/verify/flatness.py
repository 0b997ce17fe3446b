"""A flat plate: how far its points, from several poses and in one frame, lie from their common plane."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.captures.content import pose_of
from calib_core.captures.contradictions import EXCLUDED, unfit
from calib_core.captures.placement import Placement
from calib_core.captures.scans import ScanGroup, read_scan
from calib_core.captures.sweep import sweep_poses
from calib_core.cell.carriers import carriers_of
from calib_core.errors import MeasurementError
from calib_core.findings import Finding, reasons_of
from calib_core.findings.codes.verify import PLATE_NOT_TURNED, POINTS_BESIDE_PLATE
from calib_core.frames import FloatArray, stack_matrices
from calib_core.messages import message
from calib_core.records import Capture, ReadFile, Session, Verification
from calib_core.stages.verify.decision import Estimate, checked, jackknifed, range_and_band
from calib_core.stages.verify.record import VerifyCheck, VerifyResidual

LEAST_CAPTURES = 4
_MOST_POINTS = 100_000  # of one capture: a denser one is thinned evenly
_LEAST_SPREAD_MM = 10.0
_LEAST_TURN_DEG = 10.0
_FAR, _FAR_MM = 10.0, 1.0  # robust sigmas and millimetres from the plane beyond which a point is of something else
_MOST_OF_OTHERS = 0.5
_ROUNDS = 20


@dataclass(frozen=True, eq=False)
class Plate:
    """A plate as captures from several poses show it together.

    Attributes
    ----------
    form, form_95 : Estimate or None
        Peak to valley of all points' distances from their plane, and the narrowest band that holds 95 % of them;
        None where the captures do not tell it, for `why_not`.
    residuals : list of VerifyResidual
        One row a capture.
    left_out : int
        Points so far from the plane that they are of something else.
    turned_deg : float
        How far apart the poses are turned at most.
    """

    form: Estimate | None
    form_95: Estimate | None
    residuals: list[VerifyResidual]
    why_not: str = ""
    left_out: int = 0
    turned_deg: float = 0.0

    def checks(self, limits: Verification) -> list[VerifyCheck]:
        """Return the figures beside their limits, where the captures tell them."""
        if self.form is None or self.form_95 is None:
            return []
        return [
            checked("flatness", self.form, limits.flatness_mm),
            checked("flatness_95", self.form_95, limits.flatness_95_mm),
        ]

    @property
    def findings(self) -> list[Finding]:
        """What is to be doubted about the figures, and what else is worth knowing."""
        found: list[Finding] = []
        if self.form is not None and self.turned_deg < _LEAST_TURN_DEG:
            found.append(PLATE_NOT_TURNED(turned_deg=self.turned_deg))
        if self.left_out:
            found.append(POINTS_BESIDE_PLATE(count=self.left_out))
        return found


def plate(session: Session, captures: Sequence[Capture], read: ReadFile, placement: Placement) -> Plate | None:
    """Return the plate that captures show by where the scanner is, None where there is no capture of one.

    Raises
    ------
    InputError
        If a file or a pose is of no use.
    """
    used = [capture for capture in captures if not capture.excluded]
    if not used:
        return None
    unused = {c.id: str(EXCLUDED) for c in captures if c.excluded} | reasons_of(unfit(session.cell, used))
    points: dict[str, FloatArray] = {}
    rotations: list[FloatArray] = []
    for capture in used:
        if capture.id in unused:
            continue
        try:
            own, turned = _on_carrier(session, capture, read, placement)
        except MeasurementError as error:
            unused[capture.id] = str(error)
            continue
        points[capture.id] = own
        rotations.append(turned)
    rows = [VerifyResidual(capture=c.id, used=False, reason=unused.get(c.id)) for c in captures]
    if len(points) < LEAST_CAPTURES:
        why = message(
            "It needs {least} captures of the plate that can be used; there are {count}.",
            least=LEAST_CAPTURES,
            count=len(points),
        )
        return Plate(None, None, rows, why)
    return _flatness(captures, points, unused, _most_apart_deg(rotations))


def _flatness(
    captures: Sequence[Capture], points: dict[str, FloatArray], unused: dict[str, str], turned_deg: float
) -> Plate:
    every = np.concatenate(list(points.values()))
    normal, middle = robust_plane(every)
    distance = {name: (own - middle) @ normal for name, own in points.items()}
    limit = _limit(np.concatenate(list(distance.values())))
    of_plate = {name: own[np.abs(distance[name]) <= limit] for name, own in points.items()}
    rows: list[VerifyResidual] = []
    for capture in captures:
        own = points.get(capture.id)
        if own is None:
            rows.append(VerifyResidual(capture=capture.id, used=False, reason=unused.get(capture.id)))
            continue
        kept = of_plate[capture.id]
        if len(kept) < _MOST_OF_OTHERS * len(own):
            reason = str(
                message(
                    "most of its points lie off the others' plane: they are not of the plate, or its pose is wrong"
                )
            )
            rows.append(VerifyResidual(capture=capture.id, used=False, points=len(own), reason=reason))
            del of_plate[capture.id]
    counted = [own for own in of_plate.values() if len(own)]
    told = {row.capture for row in rows}
    if len(counted) < LEAST_CAPTURES or _width_mm(np.concatenate(counted)) < _LEAST_SPREAD_MM:
        rows += [VerifyResidual(capture=name, used=False) for name in of_plate if name not in told]
        why = message(
            "Its captures lie within {spread_mm:.0f} mm of one line: spread them over the plate.",
            spread_mm=_LEAST_SPREAD_MM,
        )
        if len(counted) < LEAST_CAPTURES:
            why = message(
                "It needs {least} captures of the plate that lie in one plane; {count} do.",
                least=LEAST_CAPTURES,
                count=len(counted),
            )
        return Plate(None, None, _ordered(rows, captures), why)
    form, band = flatness(counted)
    normal, middle = plane_of(np.concatenate(counted))
    for name, own in of_plate.items():
        off = (own - middle) @ normal
        rows.append(
            VerifyResidual(
                capture=name,
                used=True,
                points=len(own),
                surface_rms_mm=float(np.sqrt(np.mean(off**2))),
                plane_offset_mm=float(off.mean()),
            )
        )
    others = len(every) - sum(len(own) for own in counted)
    return Plate(form, band, _ordered(rows, captures), left_out=others, turned_deg=turned_deg)


def flatness(points_in_base: Sequence[FloatArray]) -> tuple[Estimate, Estimate]:
    """Return peak to valley and the 95 % band about the plane of all captures' points, with their U.

    Parameters
    ----------
    points_in_base : a list of (N, 3), one a capture

    Notes
    -----
    2634-style: the range of the points' signed distances from their least-squares plane.  Captures err as a whole,
    so the uncertainty comes from leaving out each in turn (jackknife).
    """
    whole, sigmas = jackknifed(_figures, points_in_base)
    first, second = (Estimate(float(v), 2 * float(s)) for v, s in zip(whole, sigmas, strict=True))
    return first, second


def plane_of(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the unit normal (3,) of the least-squares plane of points (N, 3), and their middle."""
    middle = points.mean(axis=0)
    local = points - middle
    return np.linalg.eigh(local.T @ local)[1][:, 0], middle


def robust_plane(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a plane of most of the points (N, 3), whatever lies beside it: its unit normal and a point of it."""
    rng = np.random.default_rng(len(points))  # the same points always give the same plane
    some = points[:: max(1, len(points) // 4000)]
    best: tuple[float, FloatArray, FloatArray] | None = None
    for _ in range(200):
        corners = some[rng.choice(len(some), 3, replace=False)]
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        length = float(np.linalg.norm(normal))
        if length < 1e-9:
            continue
        normal = normal / length
        spread = float(np.median(np.abs((some - corners[0]) @ normal)))
        if best is None or spread < best[0]:
            best = spread, normal, corners[0]
    if best is None:  # all on one line: any plane through it
        return plane_of(points)
    _, normal, middle = best
    before = 0
    for _ in range(_ROUNDS):
        off = (points - middle) @ normal
        near = np.abs(off) <= _limit(off)
        normal, middle = plane_of(points[near])
        if before == (before := int(near.sum())):
            break
    return normal, middle


def _limit(off_mm: FloatArray) -> float:
    """Return how far from the plane a point may be of the plate still."""
    return max(_FAR * 1.4826 * float(np.median(np.abs(off_mm))), _FAR_MM)


def _figures(points: FloatArray) -> tuple[float, float]:
    normal, middle = plane_of(points)
    return range_and_band((points - middle) @ normal)


def _on_carrier(
    session: Session, capture: Capture, read: ReadFile, placement: Placement
) -> tuple[FloatArray, FloatArray]:
    """Return a capture's points (N, 3) on what carries the plate, and how the scanner was turned there (3, 3)."""
    scan = read_scan(session, ScanGroup((capture,)), placement, read)
    rows = np.asarray(scan.points_in_laser_mm, dtype=float)
    ways = scan.turntable_from_laser
    if carriers_of(session.cell, capture).over_robot < 0:  # the flange carries the plate
        sweep = capture.kind == "sweep"
        poses = sweep_poses(session.cell, capture) if sweep else [pose_of(session.cell, capture)]
        ways = stack_matrices([(placement.foot(capture) @ pose).inverse() for pose in poses]) @ ways
    ways = np.broadcast_to(ways, (len(rows), 4, 4))
    points = (np.einsum("pij,pcj->pci", ways[:, :3, :3], rows) + ways[:, None, :3, 3]).reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        raise MeasurementError("points of the plate", "none", "Capture the plate again.", capture.id)
    return points[:: max(1, -(-len(points) // _MOST_POINTS))], ways[len(ways) // 2, :3, :3]


def _width_mm(points: FloatArray) -> float:
    """Return how far points spread across the direction in which they spread most."""
    local = points - points.mean(axis=0)
    across = local @ np.linalg.eigh(local.T @ local)[1][:, 1]
    return float(np.ptp(across))


def _most_apart_deg(rotations: Sequence[FloatArray]) -> float:
    cosines = [(float(np.trace(one.T @ other)) - 1) / 2 for one in rotations for other in rotations]
    return float(np.degrees(np.arccos(np.clip(min(cosines, default=1.0), -1.0, 1.0))))


def _ordered(rows: Sequence[VerifyResidual], captures: Sequence[Capture]) -> list[VerifyResidual]:
    places = {capture.id: k for k, capture in enumerate(captures)}
    return sorted(rows, key=lambda row: places[row.capture])
