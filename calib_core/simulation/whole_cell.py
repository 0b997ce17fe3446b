"""The whole chain on one simulated cell: the sphere beside the table, the sphere on it, then scans of a part."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from calib_core.records import Session
from calib_core.simulation.part import PartMesh, build_part
from calib_core.simulation.part_cell import PartScenario, ScanCell, take_scans
from calib_core.simulation.part_scan import PartScanner, PartScanOptions, view_poses
from calib_core.simulation.session import SimulatedSession
from calib_core.simulation.surfaces import Ball
from calib_core.simulation.table_cell import TableScenario


@dataclass(frozen=True)
class WholeScenario:
    """Captures of the sphere as in a turntable's session, then scans of the part, or of a ball, on the same table.

    The part stands on the plane z = 0 of the turntable's frame.  The robot looks from its own side; the table
    turns the part before it.
    """

    description: str = "the whole chain: sphere, turntable, then 12 scans of a part around"
    table: TableScenario = field(default_factory=TableScenario)
    part: PartScenario = field(default_factory=PartScenario)
    ball: Ball | None = None


_BALL_SCANNER = PartScanOptions(pitch_mm=0.5, width_mm=60.0, length_mm=60.0)

WHOLE_SCENARIOS: Mapping[str, WholeScenario] = MappingProxyType(
    {
        "cell": WholeScenario(),
        "ball": WholeScenario(
            "the whole chain, then 72 scans of a ball around",
            part=PartScenario(scans=72, scanner=_BALL_SCANNER),
            ball=Ball(np.array([6.0, -4.0, 60.0]), 20.0),
        ),
    }
)


def with_scans(calibrated: SimulatedSession, whole: WholeScenario, seed: int) -> SimulatedSession:
    """Return a turntable's session with scans added; robot and encoder err as in its captures."""
    options = whole.part
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
    part, aim_mm = (build_part(), 25.0) if whole.ball is None else (whole.ball, float(whole.ball.center_mm[2]))
    place = ScanCell(calibrated.world.tool0_from_laser, calibrated.table.base_from_turntable)
    # A view from azimuth φ of the part is taken from the robot's side, azimuth 180° of the base.
    azimuths_deg = 360.0 / options.scans * np.arange(options.scans)
    views = zip(view_poses(options.scans, aim_mm=aim_mm), ((180.0 - azimuths_deg) % 360.0).tolist(), strict=True)
    stops = sorted(views, key=lambda stop: stop[1])
    rng = np.random.default_rng([seed, 20_264])
    captures, files = take_scans(as_there, PartScanner(part, as_there.scanner), place, stops, rng)
    for capture in captures:
        capture["table_deg"] = table.direction * table.encoder_scale * capture["table_deg"]
    ball = Ball(part.ball_center_mm, part.ball_radius_mm) if isinstance(part, PartMesh) else part
    record = calibrated.session.to_json()
    record["captures"] += captures
    truth = {
        **calibrated.truth,
        "ball_center_in_turntable_mm": ball.center_mm.tolist(),
        "ball_diameter_mm": 2 * ball.radius_mm,
    }
    return replace(
        calibrated, session=Session.model_validate(record), files={**calibrated.files, **files}, truth=truth
    )
