"""Cells of any topology, drawn for tests: 1 to 3 scanners, 0 to 3 axes, 1 to 4 balls."""

from dataclasses import replace

from hypothesis import strategies as st

from calib_core.simulation import TcpScenario, TopologyScenario
from calib_core.simulation.topology import AxisOptions, BallOptions, ScannerOptions

_PLACES_MM = ((900.0, 150.0, 420.0), (830.0, 60.0, 470.0), (960.0, 250.0, 380.0), (770.0, 190.0, 440.0))
_OFF_AXIS_MM = ((35.0, 10.0, 60.0), (-25.0, 20.0, 75.0), (15.0, -30.0, 66.0), (-20.0, -25.0, 70.0))


@st.composite
def topologies(draw: st.DrawFn, noise: TcpScenario = TcpScenario(window_x_mm=100.0)) -> TopologyScenario:  # noqa: B008
    """Return a cell whose every scanner sees a ball that moves before it."""
    axes = draw(st.lists(_axes(), max_size=3, unique_by=lambda axis: axis.name))
    ends = draw(st.lists(st.sampled_from(["tool0", "base"]), min_size=1, max_size=3))
    scanners = tuple(
        ScannerOptions(f"scanner{k + 1}", "base" if on == "base" else "tool0", 0.3 * k)
        for k, on in enumerate(ends)
    )
    objects = [axis.name for axis in axes if axis.carries == "object"]
    carriers = ["base"] if "tool0" in ends and (not objects or draw(st.booleans())) else []
    carriers += ["tool0"] if "base" in ends else []
    carriers += objects[-1:]
    count = draw(st.integers(len(carriers), 4))
    carriers += draw(
        st.lists(st.sampled_from(carriers), min_size=count - len(carriers), max_size=count - len(carriers))
    )
    last = next((axis for axis in reversed(axes) if axis.carries == "object"), None)
    balls = tuple(_ball(k, on, last) for k, on in enumerate(carriers))
    told = "names" if draw(st.booleans()) else "distances"
    return TopologyScenario("drawn", scanners, balls, tuple(axes), noise, told, at_once=False, on_axes=14)


@st.composite
def _axes(draw: st.DrawFn) -> AxisOptions:
    kind = draw(st.sampled_from(["rotary", "linear"]))
    carries = draw(st.sampled_from(["object", "robot"]))
    direction = draw(st.sampled_from([(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)]))
    name = f"{carries}-{kind}-{'xyz'[direction.index(1.0)]}"
    reach = {"rotary": (-40.0, 40.0), "linear": (0.0, 120.0)}[kind]
    turns = AxisOptions(name, "rotary", low=reach[0], high=reach[1], direction=draw(st.sampled_from([1, -1])))
    axis = replace(turns, carries="robot" if carries == "robot" else "object", direction_in_base=direction)
    return axis if kind == "rotary" else replace(axis, kind="linear", sigma=0.02)


def _ball(number: int, on: str, last: AxisOptions | None) -> BallOptions:
    place = _PLACES_MM[number]
    if on == "tool0":
        place = (25.0, -40.0 + 50.0 * number, 130.0)
    elif on != "base":
        assert last is not None
        (x, y, z), (across, aside, up) = last.point_in_base_mm, _OFF_AXIS_MM[number]
        place = (x + across, y + aside, z + up)
    return BallOptions(
        f"ball{number + 1}", on, place, mount=None if on in ("base", "tool0") else f"mount{number + 1}"
    )
