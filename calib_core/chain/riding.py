"""Where scanners on the flange are by captures of balls that ride on axes, where no still ball places them.

Seen from what carries such a ball it stands still, and the robot is moved: by the axes that carry the ball, from
the last to the first and backwards, as if they carried its foot.  So axes and scanners are found as those of a
robot on axes before a still ball.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from calib_core.cell.layout import MovedAxis
from calib_core.chain.observations import SphereObservation, SphereSize, TableObservation
from calib_core.chain.table_given import TurntableOptions
from calib_core.chain.tcp import solve_tcp
from calib_core.chain.tcp_solution import TcpOptions, TcpSolution


def by_riding(
    observations: Sequence[TableObservation], sphere: SphereSize, options: TurntableOptions
) -> TcpSolution:
    """Return where scanners on the flange are, and axes as they carry the robot, seen from most of the balls.

    Raises
    ------
    MotionError
        As `solve_tcp` does.
    """
    carrier = Counter(o.axis for o in observations).most_common(1)[0][0]
    told = {axis.name: axis for axis in options.axes or (MovedAxis(carrier),)}
    way = [told[carrier]]
    while way[-1].on in told:
        way.append(told[way[-1].on])
    feet = [axis for axis in options.axes if axis.carries == "robot"]
    axes, on = list[MovedAxis](), "base"
    for axis in (*way, *feet):
        axes.append(MovedAxis(axis.name, axis.kind, "robot", on))
        on = axis.name
    turned = {axis.name for axis in way}
    seen = [_from_ball(o, turned) for o in observations if o.axis == carrier]
    sigmas = dict(zip((axis.name for axis in options.axes), options.axis_sigmas, strict=True))
    given = TcpOptions(
        position_sigma_mm=options.position_sigma_mm,
        orientation_sigma_rad=options.orientation_sigma_rad,
        point_sigma_mm=options.point_sigma_mm,
        priors=options.priors,
        axes=tuple(axes),
        axis_scales=(False,) * len(axes),  # what is seen from the axes is judged as such: there they are sought
        axis_sigmas=tuple(sigmas.get(axis.name, options.angle_sigma_rad) for axis in axes),
    )
    return solve_tcp(seen, sphere, given)


def _from_ball(seen: TableObservation, turned: set[str]) -> SphereObservation:
    placed = seen.placed
    readings = {name: -value if name in turned else value for name, value in placed.readings.items()}
    return replace(placed, carriers=seen.sphere.carriers, readings=readings)
