"""More of a simulated cell of any topology: scans of a part, and captures beyond those of its session."""

from typing import Any, Final

import numpy as np

from calib_core.records import Session
from calib_core.simulation.motion import back
from calib_core.simulation.part_cell import in_one_frame, organised_pcd
from calib_core.simulation.part_scan import PartScanner, PartScanOptions
from calib_core.simulation.profile_cell import pose_numbers
from calib_core.simulation.surfaces import Ball
from calib_core.simulation.topology_cell import axes_read, captured_again, simulate_topology, stop_at, world_of
from calib_core.simulation.topology_wanted import TopologyScenario

_SCANNER: Final = PartScanOptions(pitch_mm=0.5, width_mm=60.0, length_mm=60.0)


def simulate_with_scans(
    options: TopologyScenario, name: str, seed: int
) -> tuple[Session, dict[str, bytes], dict[str, Any]]:
    """Return the session of a cell of any topology, `scans` of a part added to it."""
    session, files, truth = simulate_topology(options, name, seed)
    if not options.scans:
        return session, files, truth
    part, rng = _Part(options, seed), np.random.default_rng([seed, 20_273])
    record = session.to_json()
    for mounted in part.seen_by:
        for number in range(options.scans):
            scan, file = part.scanned(mounted, f"scan{number + 1:02d}{'-' if mounted else ''}{mounted}", rng)
            record["captures"].append(scan)
            files |= file
    told = {
        "part_center_mm": part.ball.center_mm.tolist(),
        "part_diameter_mm": 2 * part.ball.radius_mm,
        "part_on": part.carrier,
    }
    return Session.model_validate(record), files, truth | told


def one_more(
    options: TopologyScenario, seed: int, step: str, name: str, rng: np.random.Generator
) -> tuple[dict[str, Any], dict[str, bytes]] | None:
    """Return one more capture for a step, of a ball or of the part; None where the cell has none for it."""
    if step != "scan":
        return captured_again(options, seed, step, name, rng)
    part = _Part(options, seed)
    return part.scanned(part.seen_by[int(rng.integers(len(part.seen_by)))], name, rng) if part.seen_by else None


class _Part:
    """A part: a ball in the place of the first one on the last axis under the object.

    Without an axis it is on the flange where all scanners stand still, else in base.
    """

    def __init__(self, options: TopologyScenario, seed: int) -> None:
        self._options = options
        self._world = world_of(options, np.random.default_rng([seed, 20_268]))
        objects = [axis.name for axis in options.axes if axis.carries == "object"]
        still = all(one.on == "base" for one in options.scanners)
        self.carrier = objects[-1] if objects else "tool0" if still else "base"
        self._aim = next(ball for ball in options.balls if ball.on == self.carrier)
        self.ball = Ball(self._world.balls[self._aim.name][1], self._world.radii_mm[self._aim.name])
        self._scanner = PartScanner(self.ball, _SCANNER)

    @property
    def seen_by(self) -> list[str]:
        """The scanners before which something moves it."""
        return [one for one in self._world.scanners if self._world.sees_move(one, self.carrier)]

    def scanned(
        self, scanner: str, capture: str, rng: np.random.Generator
    ) -> tuple[dict[str, Any], dict[str, bytes]]:
        """Return a scan by a scanner, its record and its file."""
        world, options = self._world, self._options
        stop = stop_at(world, options, scanner, self._aim, False, rng)
        flange = world.base_from_foot(stop.true) @ stop.actual
        moved = {"base": np.eye(4), "tool0": flange}.get(self.carrier)
        moved = world.moved(self.carrier, stop.true) if moved is None else moved
        scan = self._scanner.scan(back(moved) @ back(world.laser_from_base(scanner, flange)), rng)
        file = f"captures/{capture}.pcd"
        record = {"id": capture, "step": "scan", "kind": "cloud", "files": [file]}
        record |= {"pose": pose_numbers(stop.commanded), **({"scanner": scanner} if scanner else {})}
        files = {file: organised_pcd(in_one_frame(scan, _SCANNER))}
        return record | axes_read(options, stop.read, on_axis=True), files
