"""Starts of several scanners and balls: each scanner's by itself, then one state of all together."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib_core.cell.layout import AxisState, Layout, MovedAxis
from calib_core.cell.walk import Position
from calib_core.chain.axes_start import FITS_MM, in_other_units
from calib_core.chain.balls import candidates, middle_of
from calib_core.chain.chain_data import ChainData
from calib_core.chain.foot_start import feet_of, on_foot
from calib_core.chain.model import ChainState
from calib_core.chain.observations import Observations, SphereObservation, SphereSize
from calib_core.chain.rejection import core_of
from calib_core.chain.sides import ChosenSides
from calib_core.chain.start import Centers, Start, centers_of, find_starts
from calib_core.frames import FloatArray

_STILL_MM = 2.0


def main_balls(observations: Observations, groups: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return which observations of each scanner are of the ball that it saw most."""
    found: list[np.ndarray] = []
    for some in groups:
        balls = Counter((observations[k].carriers.ball, observations[k].ball) for k in some)
        main = balls.most_common(1)[0][0]
        found.append(np.array([k for k in some if (observations[k].carriers.ball, observations[k].ball) == main]))
    return found


def with_other_balls(
    data: ChainData, centers: Centers, state: ChainState, core: np.ndarray
) -> tuple[ChainState, np.ndarray]:
    """Return a state with the places of balls that no scanner saw most, and captures that agree with it."""
    places, core, at = state.position.places.copy(), core.copy(), state.position
    for place in np.flatnonzero(~np.isfinite(places).all(axis=1)):
        some = np.flatnonzero(data.walk.place == place)
        n = int(data.walk.scanner[some[0]])
        own = some[data.walk.scanner[some] == n]
        both = candidates(centers.chosen(own), at.mount_rotations[n], at.mount_translations[n])
        places[place], misfit = middle_of(both)
        core[own] = core_of(misfit)
    if np.isfinite(at.places).all():
        return state, core
    return ChainState.at(data, replace(at, places=places)), core


def moving_axes(observations: Observations, axes: Sequence[MovedAxis]) -> tuple[MovedAxis, ...]:
    """Return the axes that carry the robot and that moved between captures of the still sphere."""
    moved = [axis for axis in axes if axis.carries == "robot"]
    return tuple(axis for axis in moved if len({o.readings.get(axis.name, 0.0) for o in observations}) > 1)


def starts_of(
    observations: Observations, sphere: SphereSize, layout: Layout, groups: Sequence[np.ndarray]
) -> tuple[tuple[AxisState, ...], list[list[Start]]]:
    """Return the axes under the robot, and each scanner's starts, the likeliest first.

    Raises
    ------
    MotionError
        If readings of such an axis fit in another unit than that of the record.
    """
    if not layout.axes:
        return (), [_with_others(observations, sphere, some) for some in groups]
    axes, scatter_mm = feet_of(observations, sphere, layout, groups)
    if scatter_mm > FITS_MM:
        _require_units(observations, sphere, layout, groups)
    standing = on_foot(observations, layout, axes)
    return axes, [_with_others(standing, sphere, some) for some in groups]


def _require_units(
    observations: Observations, sphere: SphereSize, layout: Layout, groups: Sequence[np.ndarray]
) -> None:
    """Raise MotionError where readings of an axis under the robot fit in another unit."""
    told = np.array([[o.readings.get(axis.name, 0.0) for axis in layout.axes] for o in observations])
    for readings, error in in_other_units(layout.axes, told):
        names = [axis.name for axis in layout.axes]
        read = [
            replace(o, readings={**o.readings, **dict(zip(names, row, strict=True))})
            for o, row in zip(observations, readings.tolist(), strict=True)
        ]
        if feet_of(read, sphere, layout, groups)[1] < FITS_MM:
            raise error


def _with_others(observations: Observations, sphere: SphereSize, some: np.ndarray) -> list[Start]:
    """Return the starts of a scanner's captures of its main ball that let its other balls stand still as well."""
    main = observations[some[0]]
    starts = find_starts(centers_of([observations[k] for k in some], sphere))
    others: dict[tuple[str, str], list[SphereObservation]] = {}
    for o in observations:
        if o.scanner == main.scanner and (o.carriers.ball, o.ball) != (main.carriers.ball, main.ball):
            others.setdefault((o.carriers.ball, o.ball), []).append(o)
    balls = [centers_of(own, sphere) for own in others.values() if len(own) > 1]
    if not balls:
        return starts
    off = [
        max(float(np.median(middle_of(candidates(ball, one.rotation, one.translation))[1])) for ball in balls)
        for one in starts
    ]
    limit = max(2 * min(off), _STILL_MM)
    return [one for one, far in zip(starts, off, strict=True) if far <= limit]


def together(
    data: ChainData, groups: Sequence[np.ndarray], chosen: Sequence[ChosenSides], axes: tuple[AxisState, ...]
) -> tuple[ChainState, np.ndarray, FloatArray]:
    """Return a state from what scanners found one by one, captures that agree with it, and the sides' spread."""
    layout, starts = data.walk.layout, [one.start for one in chosen]
    core, spread = np.zeros(data.count, dtype=bool), np.zeros((data.unknowns, data.unknowns))
    centers: list[list[FloatArray]] = [[] for _ in layout.places]
    unseen = np.full(3, np.nan)
    for n, (some, one) in enumerate(zip(groups, chosen, strict=True)):
        core[some] = core_of(one.start.misfit_mm)
        place = int(data.walk.place[some[0]])
        centers[place].append(one.start.center)
        columns = [
            *range(*layout.mount(n).indices(data.unknowns)),
            *range(*layout.place(place).indices(data.unknowns)),
        ]
        spread[np.ix_(columns, columns)] += one.spread
    position = Position(
        np.array([start.rotation for start in starts]),
        np.array([start.translation for start in starts]),
        np.array([np.mean(found, axis=0) if found else unseen for found in centers]),
        axes,
    )
    return ChainState.at(data, position), core, spread
