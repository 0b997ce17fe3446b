"""Scans of a part in a simulated cell of any topology, by each scanner before which something moves it."""

from typing import Any

import numpy as np

from calib_core.records import Session
from calib_core.simulation.motion import back
from calib_core.simulation.part_cell import in_one_frame, organised_pcd
from calib_core.simulation.part_scan import PartScanner, PartScanOptions
from calib_core.simulation.profile_cell import pose_numbers
from calib_core.simulation.surfaces import Ball
from calib_core.simulation.topology import build_topology
from calib_core.simulation.topology_cell import axes_read, simulate_topology, stop_at
from calib_core.simulation.topology_wanted import TopologyScenario

_SCANNER = PartScanOptions(pitch_mm=0.5, width_mm=60.0, length_mm=60.0)


def simulate_with_scans(
    options: TopologyScenario, name: str, seed: int
) -> tuple[Session, dict[str, bytes], dict[str, Any]]:
    """Return the session of a cell of any topology, `scans` of a part added: a ball in the place of the first one.

    The part is on the last axis that carries the object, else on the flange where all scanners stand still, else
    in base.
    """
    session, files, truth = simulate_topology(options, name, seed)
    if not options.scans:
        return session, files, truth
    world = build_topology(
        options.scanners, options.balls, options.axes, options.cell.sphere_diameter_sigma_mm,
        np.random.default_rng([seed, 20_268]),
    )  # fmt: skip
    objects = [axis.name for axis in options.axes if axis.carries == "object"]
    still = all(one.on == "base" for one in options.scanners)
    carrier = objects[-1] if objects else "tool0" if still else "base"
    ball = next(ball for ball in options.balls if ball.on == carrier)
    part = Ball(world.balls[ball.name][1], world.radii_mm[ball.name])
    scanner, rng = PartScanner(part, _SCANNER), np.random.default_rng([seed, 20_273])
    record = session.to_json()
    for mounted in [one for one in world.scanners if world.sees_move(one, carrier)]:
        for number in range(options.scans):
            stop = stop_at(world, options, mounted, ball, False, rng)
            flange = world.base_from_foot(stop.true) @ stop.actual
            moved = {"base": np.eye(4), "tool0": flange}.get(carrier)
            moved = world.moved(carrier, stop.true) if moved is None else moved
            scan = scanner.scan(back(moved) @ back(world.laser_from_base(mounted, flange)), rng)
            capture = f"scan{number + 1:02d}{'-' if mounted else ''}{mounted}"
            files[f"captures/{capture}.pcd"] = organised_pcd(in_one_frame(scan, _SCANNER))
            record["captures"].append(
                {"id": capture, "step": "scan", "kind": "cloud", "files": [f"captures/{capture}.pcd"]}
                | {"pose": pose_numbers(stop.commanded), **({"scanner": mounted} if mounted else {})}
                | axes_read(options, stop.read, on_axis=True)
            )
    told = {"part_center_mm": part.center_mm.tolist(), "part_diameter_mm": 2 * part.radius_mm, "part_on": carrier}
    return Session.model_validate(record), files, truth | told
