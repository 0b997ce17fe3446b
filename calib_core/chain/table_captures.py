"""Captures of the turntable as its solver takes them: with their noise, corrected by what is known of the scanner.

Then as arrays, and where the fit starts.
"""

from dataclasses import replace

import numpy as np

from calib_core.cell.layout import AxisState, Layout
from calib_core.cell.walk import Position
from calib_core.chain.arrays import chain_data, layout_of
from calib_core.chain.axes_balls import balls_on_axes
from calib_core.chain.axes_start import axes_guesses, axes_start
from calib_core.chain.chain_data import ChainData, ToolPrior
from calib_core.chain.effective import with_effective_points
from calib_core.chain.held import Held
from calib_core.chain.model import ChainState
from calib_core.chain.observations import (
    SphereSize,
    TableObservation,
    TableObservations,
    with_own_sigmas,
)
from calib_core.chain.scanner import corrected
from calib_core.chain.table_given import KnownTool, TurntableOptions
from calib_core.chain.table_start import TableStart, both_centers_in_base, find_table_start
from calib_core.errors import MotionError
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray

_LEAST_CAPTURES = 4


def require_captures(observations: TableObservations) -> None:
    """Refuse too few captures."""
    if len(observations) < _LEAST_CAPTURES:
        need = "at least {least_captures} captures of the sphere on the turntable (better 8 at each of 2 heights)"
        to_do = "Turn the table by 45° and capture the sphere again, all around; then do so at a second height."
        raise MotionError(need, str(len(observations)), to_do, least_captures=_LEAST_CAPTURES)


def table_data(
    observations: TableObservations,
    sphere: SphereSize,
    point_sigma: float | None,
    tool: KnownTool,
    options: TurntableOptions,
) -> ChainData:
    """Return captures as arrays, with the tool as known as the stage before leaves it."""
    placed, known = [o.placed for o in observations], tool.held
    layout = _layout(observations, tool, options)
    data = chain_data(placed, sphere, point_sigma, options.priors if tool.sought else None, layout)
    data = replace(data, distances=layout.apart(options.distances))
    if tool.sought:
        return tool.sought.left_open.shifts.holding(data)
    for n, axis in enumerate(layout.axes):
        if axis.carries == "robot":  # known with the tool, or never moved
            data = data.holding(layout.axis(n))
    if known is None:
        first = layout.mount(0)
        return data.holding(np.arange(first.start, first.stop))
    some = known.mounts_and_scanners
    found = known.found
    # Where points are corrected by what was found, its uncertainty is left.
    values = np.where(known.data.of_files, 0.0, found.scanner) if known.applied else found.scanner
    mounts = found.position.mount_rotations, found.position.mount_translations
    prior = ToolPrior(*mounts, values, covariance_of(known.covariance[np.ix_(some, some)]))
    sigmas = np.zeros(len(data.kinds))
    sigmas[known.active] = 1.0  # the prior of the tool and the scanner together takes their place
    return replace(data, tool_prior=prior, nuisance_sigmas=sigmas)


def _layout(observations: TableObservations, tool: KnownTool, options: TurntableOptions) -> Layout:
    layout = layout_of([o.placed for o in observations], options.axes)
    if tool.state is not None:
        return replace(layout, mounts=tool.state.walk.layout.mounts)
    exact_first = sorted(layout.mounts, key=lambda mount: [*tool.late, mount[0]].index(mount[0]))
    return replace(layout, mounts=tuple(exact_first))


def start_of(
    observations: TableObservations, sphere: SphereSize, tool: KnownTool, options: TurntableOptions
) -> TableStart:
    """Return where the fit starts: by circles about one axis, or by all axes' directions."""
    if not options.axes:
        return find_table_start(observations, sphere, tool.mounts)
    data, centers = start_data(observations, sphere, tool, options)
    position, misfit = axes_start(data.walk, centers, _mounts(tool), _known_axes(tool))
    state = ChainState.at(data, position)
    return TableStart(state.table, np.zeros(len(observations)), misfit, position)


def balls_of_arcs(
    observations: TableObservations, sphere: SphereSize, tool: KnownTool, options: TurntableOptions
) -> np.ndarray | None:
    """Return which ball of its mounting each arc is of, as `balls_on_axes` does."""
    data, centers = start_data(observations, sphere, tool, options)
    return balls_on_axes(data.walk, centers, axes_guesses(data.walk, centers, _mounts(tool), _known_axes(tool)))


def start_data(
    observations: TableObservations, sphere: SphereSize, tool: KnownTool, options: TurntableOptions
) -> tuple[ChainData, FloatArray]:
    """Return captures as arrays and their balls' possible centres in base."""
    layout = _layout(observations, tool, options)
    data = chain_data([o.placed for o in observations], sphere, None, layout=layout)
    return data, both_centers_in_base(observations, sphere, tool.mounts)


def _known_axes(tool: KnownTool) -> dict[str, AxisState]:
    """Return the axes that were found with the tool."""
    if (state := tool.state) is None:
        return {}
    return {axis.name: at for axis, at in zip(state.walk.layout.axes, state.position.axes, strict=True)}


def _mounts(tool: KnownTool) -> tuple[FloatArray, FloatArray]:
    if tool.state is None:
        every = list(tool.late.values()) or [tool.mount_from_laser]
        return np.array([one.rotation for one in every]), np.array([one.translation_mm for one in every])
    answer = tool.state.position
    return answer.mount_rotations, answer.mount_translations


def table_with_effective_points(observations: TableObservations, sphere: SphereSize) -> list[TableObservation]:
    """Return captures of the table that say how many of their points count as one independent one."""
    spheres = with_effective_points([o.sphere for o in observations], sphere)
    return [replace(o, sphere=s) for o, s in zip(observations, spheres, strict=True)]


def with_table_sigmas(
    observations: TableObservations, sphere: SphereSize, told_mm: float | None
) -> list[TableObservation]:
    """Return captures of the table by several scanners with the points' noise of each."""
    spheres = with_own_sigmas([o.sphere for o in observations], sphere, told_mm)
    return [replace(o, sphere=s) for o, s in zip(observations, spheres, strict=True)]


def corrected_table(observations: TableObservations, held: Held) -> list[TableObservation]:
    """Return captures of the table as a scanner without the errors that were found would have made them."""
    widths = [np.abs(o.sphere.points_in_laser_mm[:, 0]).max(initial=1.0) for o in observations]
    half_width = float(max(widths))
    names = [name for name, _ in held.state.walk.layout.mounts]
    values = [held.found.scanner[held.nuisance_row(names.index(o.sphere.scanner))] for o in observations]
    return [
        replace(o, sphere=corrected(o.sphere, own, half_width))
        for o, own in zip(observations, values, strict=True)
    ]


def start_state(data: ChainData, tool: KnownTool, start: TableStart) -> ChainState:
    """Return the first guess of all unknowns."""
    at = start.position or Position(*_mounts(tool), start.state.mounts, (start.state.axis,))
    state = ChainState.at(data, at)
    if data.tool_prior is not None:
        known = data.tool_prior
        state = replace(state.with_mounts_of(known.rotations, known.translations), scanner=known.scanner)
    return state
