"""The table of pose conventions: what each number is, its unit, and the formula of the rotation.

Rx, Ry, Rz are the right-handed rotations about x, y, z; R is the rotation of base_from_tool0 and maps column
vectors.  Sources are named by title; the values of published examples are checked in the tests.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

Form = Literal["matrix", "quaternion", "rotation-vector", "ZYX", "XYZ", "ZYZ"]


@dataclass(frozen=True)
class Convention:
    """One way to write a pose.

    Parameters
    ----------
    name : str
        As in a session's `pose_convention`.
    description : str
        One line for a person who chooses.
    numbers : str
        The names of the numbers in their order, with blanks between.
    formula : str
        The rotation from the numbers.
    units : str
        Of position and orientation.
    brands : str
        Whose controllers write it.
    source : str
        The title of what it was checked against.
    form : str
        How the orientation is coded; three letters are the axes of a product from left to right.
    listed : str
        The order in which a pose lists what `form` names: `xyzw` or `wxyz` of a quaternion, `forward` or
        `reverse` of the three angles.
    mm_per_unit : float
        Of the position.
    """

    name: str
    description: str
    numbers: str
    formula: str
    units: str
    brands: str
    source: str
    form: Form
    listed: Literal["", "xyzw", "wxyz", "forward", "reverse"] = ""
    mm_per_unit: float = 1.0

    @property
    def count(self) -> int:
        """How many numbers a pose has."""
        return len(self.numbers.split())


_QUATERNION = "R of the unit quaternion w + x i + y j + z k"
_XYZ_FIXED = "turns about the fixed axes x, then y, then z"
_POSE_FORMATS = "Roboception rc_cube documentation, appendix Pose formats"

_ALL = (
    Convention(
        "matrix",
        "4×4 matrix, row by row",
        "r11 r12 r13 x r21 r22 r23 y r31 r32 r33 z 0 0 0 1",
        "R = [r11 r12 r13; r21 r22 r23; r31 r32 r33], last row 0 0 0 1",
        "mm",
        "any",
        "the definition of base_from_tool0",
        "matrix",
    ),
    Convention(
        "quaternion-xyzw",
        "position and quaternion, scalar last",
        "x y z qx qy qz qw",
        _QUATERNION,
        "mm",
        "any",
        _POSE_FORMATS,
        "quaternion",
        "xyzw",
    ),
    Convention(
        "quaternion-wxyz",
        "position and quaternion, scalar first",
        "x y z qw qx qy qz",
        _QUATERNION,
        "mm",
        "any",
        _POSE_FORMATS,
        "quaternion",
        "wxyz",
    ),
    Convention(
        "abb",
        "ABB robtarget: trans and rot, scalar first",
        "x y z q1 q2 q3 q4",
        _QUATERNION + " with w = q1, x = q2, y = q3, z = q4",
        "mm",
        "ABB",
        "ABB RAPID Reference Manual, data type orient, examples 1 and 2",
        "quaternion",
        "wxyz",
    ),
    Convention(
        "kuka",
        "KUKA frame: A about z first in the list",
        "X Y Z A B C",
        "R = Rz(A) · Ry(B) · Rx(C)",
        "mm, degrees",
        "KUKA",
        _POSE_FORMATS + " (KUKA XYZ-ABC)",
        "ZYX",
        "forward",
    ),
    Convention(
        "fanuc",
        f"FANUC W P R: {_XYZ_FIXED}",
        "x y z W P R",
        "R = Rz(R) · Ry(P) · Rx(W)",
        "mm, degrees",
        "FANUC",
        _POSE_FORMATS + " (FANUC XYZ-WPR); two recorded FANUC sessions",
        "ZYX",
        "reverse",
    ),
    Convention(
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
    ),
    Convention(
        "staubli",
        "Stäubli VAL 3: turns about x, then the new y, then the new z",
        "x y z Rx Ry Rz",
        "R = Rx(Rx) · Ry(Ry) · Rz(Rz)",
        "mm, degrees",
        "Stäubli",
        "RoboDK post processor for Stäubli VAL 3",
        "XYZ",
        "forward",
    ),
    Convention(
        "kawasaki",
        "Kawasaki O A T: turns about z, the new y, the new z",
        "x y z O A T",
        "R = Rz(O) · Ry(A) · Rz(T)",
        "mm, degrees",
        "Kawasaki",
        _POSE_FORMATS + " (Kawasaki XYZ-OAT)",
        "ZYZ",
        "forward",
    ),
    Convention(
        "yaskawa",
        f"Yaskawa Motoman: {_XYZ_FIXED}",
        "x y z Rx Ry Rz",
        "R = Rz(Rz) · Ry(Ry) · Rx(Rx)",
        "mm, degrees",
        "Yaskawa, Motoman",
        _POSE_FORMATS + " (Yaskawa)",
        "ZYX",
        "reverse",
    ),
    Convention(
        "mitsubishi",
        f"Mitsubishi A B C: {_XYZ_FIXED}",
        "x y z A B C",
        "R = Rz(C) · Ry(B) · Rx(A)",
        "mm, degrees",
        "Mitsubishi",
        _POSE_FORMATS + " (Mitsubishi XYZ-ABC)",
        "ZYX",
        "reverse",
    ),
    Convention(
        "nachi",
        "Nachi roll pitch yaw: roll is about z and comes first in the list",
        "x y z r p y",
        "R = Rz(r) · Ry(p) · Rx(y)",
        "mm, degrees",
        "Nachi, OTC",
        "RoboDK post processor for Nachi AX and FD (its sample MOVEX line)",
        "ZYX",
        "forward",
    ),
    Convention(
        "ros",
        "ROS geometry_msgs/Pose: metres and a quaternion, scalar last",
        "x y z qx qy qz qw",
        _QUATERNION,
        "m",
        "ROS",
        "ROS geometry_msgs, message Pose; REP 103 (units)",
        "quaternion",
        "xyzw",
        1000.0,
    ),
)

CONVENTIONS: Mapping[str, Convention] = MappingProxyType({c.name: c for c in _ALL})
