"""The simulated cells of other topologies, alone and combined."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

from calib_core.simulation.scenarios import TcpScenario
from calib_core.simulation.topology import AxisOptions, BallOptions, ScannerOptions
from calib_core.simulation.topology_wanted import TopologyScenario

_FLOOR: Final = BallOptions()
_ON_FLANGE: Final = BallOptions("sphere-on-flange", "tool0", (25.0, -40.0, 130.0))
_GATE: Final = ScannerOptions("gate", "base")
_PAIR: Final = (ScannerOptions("left", beside_rad=-0.45), ScannerOptions("right", beside_rad=0.45))
_WIDE: Final = TcpScenario(window_x_mm=100.0)

_TABLE: Final = AxisOptions("table", "rotary")
_ON_TABLE: Final = (
    BallOptions("low", "table", (1090.0, -250.0, 440.0), mount="low"),
    BallOptions("high", "table", (940.0, -180.0, 600.0), mount="high"),
)
_NEAR_AXIS: Final = (  # where a fixed scanner's flat light meets them at all angles
    BallOptions("low", "table", (1035.0, -250.0, 440.0), mount="low"),
    BallOptions("high", "table", (978.0, -222.0, 456.0), mount="high"),
)
_LOWER: Final = (_ON_TABLE[0], replace(_ON_TABLE[1], at_mm=(940.0, -180.0, 540.0)))
_RAIL: Final = AxisOptions("rail", "linear", "robot", None, (0.0, 1.0, 0.0), low=0.0, high=1200.0, sigma=0.02)
_SLIDE: Final = AxisOptions("slide", "linear", "object", None, (1.0, 0.0, 0.0), low=0.0, high=400.0, sigma=0.02)
_ON_SLIDE: Final = BallOptions("slide", "slide", (800.0, -150.0, 430.0), mount="slide")
_TILT: Final = AxisOptions(
    "tilt", "rotary", "object", None, (0.0, 1.0, 0.0), (1000.0, -250.0, 450.0), low=-40.0, high=40.0
)
_TURN: Final = AxisOptions("turn", "rotary", "object", None)
_ON_TURN: Final = tuple(replace(ball, on="turn") for ball in _ON_TABLE)
_PLATE: Final = (  # nearly along the stripe, so that it often meets two or three at once
    BallOptions("a", "base", (850.0, 170.0, 420.0)),
    BallOptions("b", "base", (909.0, 151.0, 420.0)),
    BallOptions("c", "base", (953.0, 111.0, 420.0)),
)
_GANTRY: Final = TcpScenario(translations=14, orientations=0)

TOPOLOGY_SCENARIOS: Mapping[str, TopologyScenario] = MappingProxyType({
    "fixed-scanner-turntable": TopologyScenario(
        "the scanner stands still before a turntable; the robot brings a ball, too",
        (ScannerOptions(on="base"),), (_ON_FLANGE, *_NEAR_AXIS), (_TABLE,), _WIDE, side_told=True,
    ),
    "two-scanners": TopologyScenario("two scanners on the flange see one ball at once", _PAIR, at_once=True),
    "two-scanners-that-err": TopologyScenario(
        "the same; each errs in scale, shear and bow, and by the angle of light",
        _PAIR, at_once=True, scanners_err=1.0,
    ),
    "two-scanners-in-turn": TopologyScenario("two scanners on the flange, one after the other", _PAIR),
    "scanners-on-flange-and-base": TopologyScenario(
        "one scanner on the flange, one that stands still", (ScannerOptions("arm"), _GATE), (_FLOOR, _ON_FLANGE)
    ),
    "plate": TopologyScenario("a plate of three balls, nothing told of them", balls=_PLATE, cell=_WIDE),
    "plate-distances": TopologyScenario(
        "the same; their distances are known, and the scanner's scale is off by 0.3 %",
        balls=_PLATE, cell=_WIDE, told="distances", scanner_scale=1.003,
    ),
    "rail": TopologyScenario("a rail under the robot", axes=(_RAIL,)),
    "slide": TopologyScenario("a linear axis under the part", balls=(_FLOOR, _ON_SLIDE), axes=(_SLIDE,)),
    "positioner": TopologyScenario(
        "a positioner that tilts and turns the part", balls=(_FLOOR, *_ON_TURN), axes=(_TILT, _TURN)
    ),
    "tilt": TopologyScenario(
        "a table that tilts",
        balls=(_FLOOR, *(replace(ball, on="tilt") for ball in _ON_TABLE)), axes=(_TILT,),
    ),
    "positioner-geared": TopologyScenario(
        "the same positioner; tilt is geared by 1.004 and turn counts the other way round",
        balls=(_FLOOR, *_ON_TURN), axes=(replace(_TILT, scale=1.004), replace(_TURN, direction=-1)),
    ),
    "two-tables": TopologyScenario(
        "two turntables side by side",
        balls=(
            _FLOOR,
            BallOptions("one-low", "one", (1090.0, -250.0, 440.0), mount="one-low"),
            BallOptions("one-high", "one", (940.0, -180.0, 600.0), mount="one-high"),
            BallOptions("two-low", "two", (690.0, -250.0, 440.0), mount="two-low"),
            BallOptions("two-high", "two", (540.0, -180.0, 600.0), mount="two-high"),
        ),
        axes=(
            AxisOptions("one", "rotary", on="base"),
            AxisOptions("two", "rotary", on="base", point_in_base_mm=(600.0, -250.0, 380.0)),
        ),
    ),
    "gantry": TopologyScenario("a machine of three translations", cell=_GANTRY, machine="gantry"),
    "gantry-turntable": TopologyScenario(
        "the same with a turntable", balls=(_FLOOR, *_ON_TABLE), axes=(_TABLE,), cell=_GANTRY, machine="gantry"
    ),
    "scara": TopologyScenario("a machine of three translations and one turn", machine="scara"),
    "linear-turntable": TopologyScenario(
        "a scanner on one linear axis before a turntable",
        balls=(BallOptions(at_mm=(780.0, -132.0, 430.0)), *_LOWER), axes=(_TABLE,), cell=_WIDE,
        machine="linear", side_told=True,
    ),
    "rail-positioner": TopologyScenario(
        "a rail under the robot and a positioner under the part",
        balls=(_FLOOR, *_ON_TURN), axes=(_RAIL, _TILT, _TURN), on_axes=20,
    ),
    "two-scanners-turntable": TopologyScenario(
        "two scanners on the flange and a turntable", _PAIR, (_FLOOR, *_ON_TABLE), (_TABLE,), at_once=True
    ),
    "plate-on-positioner": TopologyScenario(
        "a plate of three balls on a positioner that tilts and turns",
        balls=(_FLOOR, *(replace(b, on="turn", mount="plate", at_mm=(b.at_mm[0] + 130, b.at_mm[1] - 410, 460.0))
                         for b in _PLATE)),
        axes=(_TILT, _TURN), cell=_WIDE, on_axes=30,
    ),
})  # fmt: skip
