"""Universal Robots: its pose convention."""

from calib_core.robots.brand import Brand
from calib_core.robots.convention import Convention

CONVENTION = Convention(
    "ur",
    "Universal Robots pose: metres and a rotation vector in radians",
    "x y z rx ry rz",
    "R = exp([rx ry rz]×): turn about the vector by its length",
    "m, radians",
    "Universal Robots",
    "Universal Robots forum, Pose Rotation Order (rv2rpy, rpy2rv)",
    "rotation-vector",
    "",
    1000.0,
)


class Ur(Brand):
    """Universal Robots."""

    name = "ur"
    title = "Universal Robots"
    conventions = (CONVENTION,)
    rank = 5


BRAND = Ur()
