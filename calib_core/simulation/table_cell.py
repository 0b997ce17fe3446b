"""The simulated turntable: the sphere fixed on it, seen at several angles, by the cell of the TCP captures."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from calib_core.simulation.motion import FloatArray, pose, turn
from calib_core.simulation.profile_cell import (
    Shot,
    TableReading,
    World,
    build_world,
    commanded_pose,
    draw_centers,
    shot_from,
    true_pose,
)
from calib_core.simulation.scenarios import TcpScenario

_EIGHT_DEG = tuple(45.0 * k for k in range(8))
_NOMINAL = turn([np.pi, 0.0, 0.0]) @ turn([0.0, 0.0, 0.4]) @ turn([0.35, 0.0, 0.0]).T


@dataclass(frozen=True)
class TableScenario:
    """TCP captures of the simulated cell, then captures of a sphere on its turntable.

    Parameters
    ----------
    description : str
    tcp : TcpScenario
        The cell and its TCP captures.
    angles_deg : tuple of float
        Where the table is sent, in turn, for each mounting.
    heights_mm : tuple of float
        One mounting of the sphere at each height above the table.
    radius_mm : float
        The sphere's distance from the axis.
    tilt_rad : float
        How far the axis leans from base's z: components uniform in plus or minus this.
    orientation_range_rad : float
        Of the scanner, components of the rotation vector uniform in plus or minus this.
    angle_sigma_rad : float
        The encoder's standard deviation.
    direction : {1, -1}
        Whether the encoder counts right-handed about the axis that points up.
    encoder_scale : float
        What the encoder reports for each unit that the table turns.
    wobble_rad : float
        The axis leans by this, twice around at each turn of the table (once around, it would be the mounting's).
    angle_unit : {"deg", "rad"}
        The unit of the recorded angles; radians are the user's mistake to be found.
    mixed_mounts : int
        So many captures of the second mounting are recorded as of the first.
    """

    description: str = "a sphere on a turntable: 8 angles at each of 2 heights"
    tcp: TcpScenario = field(default_factory=TcpScenario)
    angles_deg: tuple[float, ...] = _EIGHT_DEG
    heights_mm: tuple[float, ...] = (60.0, 220.0)
    radius_mm: float = 90.0
    tilt_rad: float = 0.03
    orientation_range_rad: float = 0.3
    angle_sigma_rad: float = 5e-5
    direction: Literal[1, -1] = 1
    encoder_scale: float = 1.0
    wobble_rad: float = 0.0
    angle_unit: Literal["deg", "rad"] = "deg"
    mixed_mounts: int = 0


TABLE_SCENARIOS: Mapping[str, TableScenario] = MappingProxyType(
    {
        "turntable": TableScenario(),
        "turntable-unknown-sigmas": TableScenario(
            "the same; noise, repeatability and encoder are not told", tcp=TcpScenario(sigmas="estimated")
        ),
        "turntable-one-height": TableScenario("one height only", heights_mm=(60.0,)),
        "turntable-partial": TableScenario(
            "unequal angles over less than half a turn", angles_deg=(0.0, 17.0, 40.0, 75.0, 110.0, 130.0, 155.0)
        ),
        "turntable-reversed": TableScenario("the encoder counts the other way round", direction=-1),
        "turntable-radians": TableScenario("the angles are recorded in radians", angle_unit="rad"),
        "turntable-mixed-mounts": TableScenario(
            "two captures of the high sphere are recorded as of the low one", mixed_mounts=2
        ),
        "turntable-on-axis": TableScenario("the sphere stands on the axis", radius_mm=0.0),
        "turntable-equal-angles": TableScenario("the table never turned", angles_deg=(30.0,) * 8),
        "turntable-wobble": TableScenario("the axis wobbles by 1 mrad at each turn", wobble_rad=1e-3),
        "turntable-encoder-scale": TableScenario(
            "the encoder counts 0.3 % too much", encoder_scale=1.003, angles_deg=tuple(40.0 * k for k in range(8))
        ),
        "turntable-clouds": TableScenario("an area scanner: clouds", tcp=TcpScenario(kinds=("cloud",))),
        "turntable-centers": TableScenario("a scanner that reports centres", tcp=TcpScenario(kinds=("center",))),
    }
)


@dataclass(frozen=True, eq=False)
class TableTruth:
    """The true turntable.

    Parameters
    ----------
    base_from_turntable : (4, 4)
        z the axis, upwards; the origin at the centre of the first mounting's circle; x across z, in the plane
        of z and base's x.
    mounts_mm : (M, 3)
        The sphere's centre in the turntable's frame at angle zero.
    options : TableScenario
    """

    base_from_turntable: FloatArray
    mounts_mm: FloatArray
    options: TableScenario

    @property
    def labels(self) -> tuple[str, ...]:
        """The mountings' names."""
        return ("low", "high", "third", "fourth")[: len(self.mounts_mm)]

    def center_in_base(self, mount: int, angle_rad: float) -> FloatArray:
        """Return where the sphere stands (3,) when the table has turned, wobble included."""
        wobble = turn(self.options.wobble_rad * np.array([np.cos(2 * angle_rad), np.sin(2 * angle_rad), 0.0]))
        in_table = wobble @ turn([0.0, 0.0, angle_rad]) @ self.mounts_mm[mount]
        return self.base_from_turntable[:3, :3] @ in_table + self.base_from_turntable[:3, 3]

    def truth(self) -> dict[str, Any]:
        """Return the truth as JSON data."""
        return {
            "base_from_turntable": self.base_from_turntable.tolist(),
            "axis_direction_in_base": self.base_from_turntable[:3, 2].tolist(),
            "axis_point_in_base_mm": self.base_from_turntable[:3, 3].tolist(),
            "mounts_in_turntable_mm": dict(zip(self.labels, self.mounts_mm.tolist(), strict=True)),
            "direction": self.options.direction,
            "encoder_scale": self.options.encoder_scale,
            "angle_sigma_rad": self.options.angle_sigma_rad,
        }


def build_table_world(options: TableScenario, rng: np.random.Generator) -> tuple[World, TableTruth]:
    """Return a cell with its TCP captures, then those of the sphere on its table, all drawn from `rng`."""
    world = build_world(options.tcp, rng)
    table = _table(options, rng)
    shots = tuple(
        _shot(world, table, mount, number, rng)
        for mount in range(len(options.heights_mm))
        for number in range(len(options.angles_deg))
    )
    return replace(world, shots=world.shots + shots), table


def _table(options: TableScenario, rng: np.random.Generator) -> TableTruth:
    axis = turn([*rng.uniform(-options.tilt_rad, options.tilt_rad, 2), 0.0])[:, 2]
    across = np.array([1.0, 0.0, 0.0]) - axis[0] * axis
    across /= np.sqrt(across @ across)
    rotation = np.array([across, np.cross(axis, across), axis], dtype=float).T
    origin = np.array([1000.0, -250.0, 380.0]) + rng.uniform(-60, 60, 3)
    azimuth = rng.uniform(-np.pi, np.pi, len(options.heights_mm))
    heights = np.array(options.heights_mm) - options.heights_mm[0]
    mounts = np.column_stack([options.radius_mm * np.cos(azimuth), options.radius_mm * np.sin(azimuth), heights])
    return TableTruth(pose(rotation, origin), mounts, options)


def _shot(world: World, table: TableTruth, mount: int, number: int, rng: np.random.Generator) -> Shot:
    options = table.options
    sent_rad = float(np.deg2rad(options.angles_deg[number]))
    angle_rad = options.direction * sent_rad / options.encoder_scale
    angle_rad += float(options.angle_sigma_rad * rng.standard_normal())
    expected = table.center_in_base(mount, options.direction * sent_rad)
    orientation = _NOMINAL @ turn(rng.uniform(-options.orientation_range_rad, options.orientation_range_rad, 3))
    aim = draw_centers(1, options.tcp, rng)[0]
    commanded = commanded_pose(replace(world, sphere_center_in_base_mm=expected), orientation, aim)
    actual = true_pose(commanded, options.tcp, rng)
    center_in_base = table.center_in_base(mount, angle_rad)
    index = mount * len(options.angles_deg) + number
    kind = options.tcp.kinds[index % len(options.tcp.kinds)]
    shot = shot_from(world, f"t{index + 1:02d}", kind, commanded, actual, center_in_base, rng)
    recorded = options.angles_deg[number] if options.angle_unit == "deg" else round(sent_rad, 5)
    label = table.labels[mount if mount != 1 or number >= options.mixed_mounts else 0]
    return replace(shot, table=TableReading(angle_rad, mount, recorded, label))
