"""What the session of a simulated cell of any topology says of its cell."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from calib_core.simulation.topology import (
    AxisOptions,
    BallOptions,
    TopologyWorld,
)
from calib_core.simulation.topology_wanted import TopologyScenario


def names_axes(options: TopologyScenario) -> bool:
    """Return whether the cell needs `axes`: it has others than the one turntable."""
    return [axis.name for axis in options.axes] != ["table"]


def cell_record(world: TopologyWorld, options: TopologyScenario) -> dict[str, Any]:
    """Return the cell's record: the plain fields where they say all."""
    cell = options.cell
    told: dict[str, Any] = {"pose_convention": "abb", "sphere_diameter_mm": cell.sphere_diameter_mm}
    noise: dict[str, Any] = {"kind": cell.kinds[0]}
    if cell.sphere_diameter_sigma_mm:
        told["sphere_diameter_sigma_mm"] = cell.sphere_diameter_sigma_mm
    if cell.sigmas == "given":
        noise["point_sigma_mm"] = cell.point_sigma_mm
        told["robot"] = {
            "position_sigma_mm": cell.position_sigma_mm,
            "orientation_sigma_deg": float(np.rad2deg(cell.orientation_sigma_rad)),
        }
    if len(options.scanners) == 1 and not options.scanners[0].name:
        told["scanner"] = noise
        if options.scanners[0].on == "base":
            told["arrangement"] = "sphere-on-robot"
    else:
        told["scanners"] = {one.name: {**noise, "on": one.on} for one in options.scanners}
    if options.told != "nothing":
        told["spheres"] = [
            {"name": ball.name, "diameter_mm": ball.diameter_mm, "on": ball.on} for ball in options.balls
        ]
    if options.told == "distances":
        told["sphere_distances"] = [*_distances(world, options)]
    if names_axes(options) and options.axes:
        told["axes"] = [_axis_record(axis, cell.sigmas == "given") for axis in options.axes]
    elif options.axes and cell.sigmas == "given":
        told["turntable"] = {"angle_sigma_deg": float(np.rad2deg(options.axes[0].sigma))}
    return told


def _axis_record(axis: AxisOptions, sigmas: bool) -> dict[str, Any]:
    record: dict[str, Any] = {"name": axis.name, "kind": axis.kind, "carries": axis.carries}
    if axis.on is not None:
        record["on"] = axis.on
    if sigmas and axis.kind == "linear":
        record["sigma_mm"] = axis.sigma
    elif sigmas:
        record["sigma_deg"] = float(np.rad2deg(axis.sigma))
    return record


def _distances(world: TopologyWorld, options: TopologyScenario) -> Iterator[dict[str, Any]]:
    """Give the calibrated distances of balls that stand together, exact but for rounding."""
    together: Sequence[BallOptions] = options.balls
    for place, one in enumerate(together):
        for other in together[place + 1 :]:
            if (one.on, one.mount) == (other.on, other.mount):
                apart = world.balls[one.name][1] - world.balls[other.name][1]
                yield {
                    "between": [one.name, other.name],
                    "mm": round(float(np.sqrt(apart @ apart)), 4),
                    "sigma_mm": options.distance_sigma_mm,
                }
