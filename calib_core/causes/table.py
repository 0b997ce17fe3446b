"""What is wrong with a table's angles: their unit or the size of a step, a lost step, the sense of turning.

Where the sphere stood tells each capture's angle without the ones told (`chain.table_angles`).  Angles told in
another unit, or in steps of another size, are these times one factor; after a lost step they lag by one angle.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib_core.cell.axes import with_direction
from calib_core.chain.model import ChainState
from calib_core.chain.observations import SphereSize, TableObservation, TableObservations
from calib_core.chain.table_angles import with_found_angles
from calib_core.chain.table_frame import LEVEL, TableFrame
from calib_core.chain.table_start import Mounts, TableStart, table_guess
from calib_core.errors import CalibrationError
from calib_core.findings import Finding
from calib_core.findings.codes import causes as codes
from calib_core.frames import FloatArray
from calib_core.records import BeforeAfter, Capture, Cell, Changes, RootCause, TableReading

LEAST_CAPTURES = 6
"""With fewer, angles of another size may fit well by chance."""

_SUSPICIOUS_MM = 1.0  # the median misfit of tables that are told rightly stays below
_ELSEWHERE_MM, _LEAST_ELSEWHERE = 5.0, 3
_MUCH_BETTER = 0.5
_GAIN = 6.0  # of the summed costs, so that captures that fit by chance do not count
_LEANS = "Axis off base's z, with the angles counted so"
_UNITS = {float(np.rad2deg(1.0)): "radians", 0.9: "gon", 360.0: "turns", 1 / 60: "minutes of arc"}
_NEAR_UNIT, _SAME_UNIT = 0.05, 0.005
_TELLING_MM = 500.0  # beyond it a misfit is of no table at all
_TURNS = np.arange(0.1, 4 * np.pi, 0.04)  # by how much the table may have turned altogether, rad
_NEARLY_BEST = 0.99
_DENOMINATORS = 60
_LEAST_STEP_RAD = np.deg2rad(2.0)


@dataclass(frozen=True)
class _Tried:
    reading: TableReading
    unit: str
    start: TableStart


def table_causes(
    captures: Sequence[Capture], observations: TableObservations, sphere: SphereSize, mounts: Mounts
) -> list[Finding]:
    """Return what would make captures of the sphere on the table fit far better: angles read otherwise.

    Parameters
    ----------
    captures : sequence of Capture
        Those whose angles are to be changed.
    observations : sequence of TableObservation
        With the angles as told.
    sphere : SphereSize
    mounts : RigidTransform, or each scanner's by its name
        About the tool; that of the tcp stage's start is good enough.

    Returns
    -------
    list of Finding
        With their remedies; none where the angles fit as they are, or nothing else fits.
    """
    if len(observations) < LEAST_CAPTURES:
        return []
    now = _guess(observations, sphere, mounts)
    if now is not None and _fits(now):
        return []
    try:
        found = with_found_angles(observations, sphere, mounts)
    except CalibrationError:
        return []
    angles = np.array([o.angle_rad for o in found])
    tried: list[_Tried] = []
    for reading, unit in (*_factors(observations, angles), *_lost_steps(observations, angles)):
        start = _guess(read_anew(observations, reading), sphere, mounts)
        if start is not None and _fits(start) and _explains(start, now):
            tried.append(_Tried(reading, unit, start))
    tried.sort(key=lambda one: _cost(one.start.misfit_mm))
    return [_cause(one, now, captures) for one in tried[:1]]


def _guess(observations: TableObservations, sphere: SphereSize, mounts: Mounts) -> TableStart | None:
    try:
        return table_guess(observations, sphere, mounts)
    except CalibrationError:  # fewer than three angles
        return None


def direction_findings(cell: Cell, frame: TableFrame) -> list[Finding]:
    """Return the wrong direction that the cell tells: with it, the table's axis would point down."""
    told = cell.turntable.direction
    if told is None or told == frame.direction:
        return []
    lean = float(np.rad2deg(np.arccos(np.clip(frame.axis[2], -1.0, 1.0))))
    remedy = RootCause(
        id="table-direction",
        kind="table-direction",
        evidence=[BeforeAfter(label=_LEANS, unit="°", before=180 - lean, after=lean)],
        changes=Changes(cell={"turntable": {"direction": frame.direction}}),
    )
    counts = "right" if frame.direction > 0 else "left"
    return [codes.TABLE_DIRECTION(remedy=remedy, told=told, direction=frame.direction, counts=counts)]


def axis_direction_findings(cell: Cell, state: ChainState) -> list[Finding]:
    """Return the rotary axes that turn the other way round than the cell tells of them."""
    found: list[Finding] = []
    for edge, at in zip(state.walk.layout.axes, state.position.axes, strict=True):
        up = float(at.rotation[2, 2])
        counts = 1 if up > 0 else -1
        if edge.direction in (None, counts) or edge.kind == "linear" or abs(up) < LEVEL:
            continue
        lean = float(np.rad2deg(np.arccos(np.clip(abs(up), 0.0, 1.0))))
        remedy = RootCause(
            id=f"axis-direction-{edge.name}",
            kind="table-direction",
            evidence=[BeforeAfter(label=_LEANS, unit="°", before=180 - lean, after=lean)],
            changes=Changes(cell=with_direction(cell, edge.name, counts)),
        )
        sense = "right of several" if counts > 0 else "left of several"
        found.append(
            codes.TABLE_DIRECTION(remedy=remedy, told=-counts, direction=counts, counts=sense, axis=edge.name)
        )
    return found


def read_anew(observations: TableObservations, reading: TableReading) -> list[TableObservation]:
    """Return captures of the table with their angles read in another way."""
    names = [o.sphere.capture for o in observations]
    first = names.index(reading.since) if reading.since in names else 0
    offset = np.deg2rad(reading.offset_deg)
    return [
        replace(o, angle_rad=reading.factor * o.angle_rad + (offset if k >= first else 0.0))
        for k, o in enumerate(observations)
    ]


def angles_of(reading: TableReading, captures: Sequence[Capture]) -> Changes:
    """Return what makes captures have the angles that a reading gives them, all with an angle from there on."""
    names = [capture.id for capture in captures]
    first = names.index(reading.since) if reading.since in names else 0
    patches: dict[str, dict[str, object]] = {}
    for k, capture in enumerate(captures):
        if capture.table_deg is not None and (k >= first or reading.factor != 1):
            angle = reading.factor * capture.table_deg + (reading.offset_deg if k >= first else 0.0)
            patches[capture.id] = {"table_deg": round(angle, 9)}
    return Changes(captures=patches)


def _factors(observations: TableObservations, found_rad: FloatArray) -> list[tuple[TableReading, str]]:
    """Return the factor of the told angles by which they turn as the sphere did, and the name of their unit."""
    told = np.array([o.angle_rad for o in observations])
    spread = float(np.ptp(told))
    if spread == 0:
        return []
    mounts = _mounts(observations)
    tried = np.concatenate([_TURNS, -_TURNS]) / spread
    scores = np.array([_agreement(factor * told, found_rad, mounts) for factor in tried])
    good = tried[scores >= _NEARLY_BEST * scores.max()]
    # Even steps of 45° and of 405° look alike: a known unit first, then the factor that is nearest to one.
    for unit, name in _UNITS.items():
        near = good[np.abs(np.abs(good) / unit - 1) < _NEAR_UNIT]
        if any(abs(abs(_refined(float(one), told, found_rad, mounts)) / unit - 1) < _SAME_UNIT for one in near):
            return [(TableReading(factor=unit), name)]
    nearest = float(good[np.argmin(np.abs(np.log(np.abs(good))))])
    factor = _simple(_refined(nearest, told, found_rad, mounts))
    if abs(factor - 1) < 2 * _SAME_UNIT:
        return []
    return [(TableReading(factor=factor), "factor")]


def _lost_steps(observations: TableObservations, found_rad: FloatArray) -> list[tuple[TableReading, str]]:
    """Return the captures from which on the table stood further, or less far, than told, and by how much."""
    told = np.array([o.angle_rad for o in observations])
    best: tuple[float, str, float] | None = None
    for members in _mounts(observations):
        for sign in (1.0, -1.0):
            off = np.exp(1j * (found_rad[members] - sign * told[members]))
            for k in range(2, len(members) - 1):
                before, after = off[:k].sum(), off[k:].sum()
                score = float(abs(before) + abs(after)) / len(members)
                step = sign * float(np.angle(after / before)) if abs(before) * abs(after) > 0 else 0.0
                if abs(step) > _LEAST_STEP_RAD and (best is None or score > best[0]):
                    best = score, observations[int(members[k])].sphere.capture, step
    if best is None:
        return []
    degrees = round(float(np.rad2deg(best[2])), 2)
    nearest = round(degrees)
    degrees = float(nearest) if abs(nearest - degrees) < 0.25 else degrees
    return [(TableReading(offset_deg=degrees, since=best[1]), "step")]


def _mounts(observations: TableObservations) -> list[np.ndarray]:
    """Return the places of the captures of each mounting."""
    names = np.array([o.mount for o in observations])
    return [np.flatnonzero(names == mount) for mount in dict.fromkeys(names.tolist())]


def _agreement(angles_rad: FloatArray, found_rad: FloatArray, mounts: Sequence[np.ndarray]) -> float:
    """Return how well angles agree with those found, 0 … 1, each mounting's own zero left open."""
    off = np.exp(1j * (found_rad - angles_rad))
    return float(sum(abs(off[members].sum()) for members in mounts)) / len(angles_rad)


def _refined(factor: float, told: FloatArray, found_rad: FloatArray, mounts: Sequence[np.ndarray]) -> float:
    near = factor * np.linspace(0.9, 1.1, 801)
    return float(near[np.argmax([_agreement(one * told, found_rad, mounts) for one in near])])


def _simple(factor: float) -> float:
    """Return the factor without its sign, which the table's direction holds, simple where it nearly is."""
    from fractions import Fraction

    size = abs(factor)
    for most in range(1, _DENOMINATORS + 1):
        fraction = Fraction(size).limit_denominator(most)
        if fraction and abs(float(fraction) / size - 1) < 0.002:
            return float(fraction)
    return round(size, 4)


def _fits(start: TableStart) -> bool:
    elsewhere = int((start.misfit_mm > _ELSEWHERE_MM).sum())
    return start.scatter_mm <= _SUSPICIOUS_MM and elsewhere < _LEAST_ELSEWHERE


def _explains(one: TableStart, now: TableStart | None) -> bool:
    if now is None:
        return True
    better = _rms(one.misfit_mm) < _MUCH_BETTER * _rms(now.misfit_mm)
    return better and _cost(now.misfit_mm) - _cost(one.misfit_mm) > _GAIN


def _cost(misfit_mm: FloatArray) -> float:
    return float(np.log1p((misfit_mm / _SUSPICIOUS_MM) ** 2).sum())


def _rms(misfit_mm: FloatArray) -> float:
    return float(np.sqrt(np.mean(misfit_mm**2)))


def _cause(one: _Tried, now: TableStart | None, captures: Sequence[Capture]) -> Finding:
    before = None if now is None or _rms(now.misfit_mm) > _TELLING_MM else _rms(now.misfit_mm)
    after = _rms(one.start.misfit_mm)
    reading = one.reading
    told = {"factor": f"{reading.factor:.4g}", "step": f"{reading.offset_deg:+g} from {reading.since}"}
    slug = "".join(c if c.isascii() and c.isalnum() else "-" for c in told.get(one.unit, one.unit).lower())
    about = [] if reading.since is None else list(angles_of(reading, captures).captures)
    remedy = RootCause(
        id=f"table-angles-{'-'.join(part for part in slug.split('-') if part)}"[:64],
        kind="table-angles",
        evidence=[BeforeAfter(label="Sphere off its circle, RMS", unit="mm", before=before, after=after)],
        captures=about,
        changes=angles_of(reading, captures),
        table_reading=reading,
    )
    return codes.TABLE_ANGLES(
        about,
        remedy=remedy,
        unit=one.unit,
        after_mm=after,
        factor=reading.factor,
        offset_deg=reading.offset_deg,
        since=reading.since or "",
    )
