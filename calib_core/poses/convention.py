"""What a pose convention says: what each number is, its unit, and the formula of the rotation.

Rx, Ry, Rz are the right-handed rotations about x, y, z; R is the rotation of base_from_tool0 and maps column
vectors.  Sources are named by title; the values of published examples are checked in the tests.  Each convention
stands in its brand's folder.
"""

from dataclasses import dataclass
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


QUATERNION = "R = R(q), q = qw + qx i + qy j + qz k, ‖q‖ = 1"
"""Formulas are the same in every language: they stand in reports."""
XYZ_FIXED = "turns about the fixed axes x, then y, then z"
POSE_FORMATS = "Roboception rc_cube documentation, appendix Pose formats"
