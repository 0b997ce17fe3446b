"""The whole chain on one simulated cell: the sphere beside the table, the sphere on it, then scans of a part."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from calib_core.records import Session
from calib_core.simulation.part import build_part
from calib_core.simulation.part_cell import PartScenario, ScanCell, take_scans
from calib_core.simulation.part_scan import PartScanner, view_poses
from calib_core.simulation.session import SimulatedSession
from calib_core.simulation.table_cell import TableScenario


@dataclass(frozen=True)
class WholeScenario:
    """Captures of the sphere as in a turntable's session, then scans of the part on the same table.

    The part stands on the plane z = 0 of the turntable's frame.  The robot looks from its own side; the table
    turns the part before it.
    """

    description: str = "the whole chain: sphere, turntable, then 12 scans of a part around"
    table: TableScenario = field(default_factory=TableScenario)
    part: PartScenario = field(default_factory=PartScenario)


WHOLE_SCENARIOS: Mapping[str, WholeScenario] = MappingProxyType({"cell": WholeScenario()})


def with_scans(calibrated: SimulatedSession, options: PartScenario, seed: int) -> SimulatedSession:
    """Return a turntable's session with scans of the part added; robot and encoder err as in its captures."""
    assert calibrated.world is not None
    assert calibrated.table is not None
    cell, table = calibrated.world.options, calibrated.table.options
    as_there = replace(
        options,
        scanner=replace(options.scanner, point_sigma_mm=cell.point_sigma_mm),
        position_sigma_mm=cell.position_sigma_mm,
        orientation_sigma_rad=cell.orientation_sigma_rad,
        angle_sigma_rad=table.angle_sigma_rad,
    )
    part = build_part()
    place = ScanCell(calibrated.world.tool0_from_laser, calibrated.table.base_from_turntable)
    # A view from azimuth φ of the part is taken from the robot's side, azimuth 180° of the base.
    azimuths_deg = 360.0 / options.scans * np.arange(options.scans)
    views = zip(view_poses(options.scans), ((180.0 - azimuths_deg) % 360.0).tolist(), strict=True)
    stops = sorted(views, key=lambda stop: stop[1])
    rng = np.random.default_rng([seed, 20_264])
    captures, files = take_scans(as_there, PartScanner(part, as_there.scanner), place, stops, rng)
    for capture in captures:
        capture["table_deg"] = table.direction * table.encoder_scale * capture["table_deg"]
    record = calibrated.session.to_json()
    record["captures"] += captures
    truth = {
        **calibrated.truth,
        "ball_center_in_turntable_mm": part.ball_center_mm.tolist(),
        "ball_diameter_mm": 2 * part.ball_radius_mm,
    }
    return replace(
        calibrated, session=Session.model_validate(record), files={**calibrated.files, **files}, truth=truth
    )
