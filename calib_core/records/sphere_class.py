"""How well a sphere's diameter is known: as told, or as spheres of its class are made."""

from typing import Final

from calib_core.records.session import Cell, SphereClass

ASSUMED_CLASS: Final[SphereClass] = "coated"
"""Of a sphere of which nothing is told but its diameter: most are sprayed or blasted so that they do not glare."""

_SIGMAS_MM: Final[dict[SphereClass, float]] = {"certified": 0.002, "bearing": 0.01, "coated": 0.04, "turned": 0.1}


def diameter_sigma_mm(cell: Cell) -> float:
    """Return the standard uncertainty of the sphere's diameter: as told, or that of its class."""
    if cell.sphere_diameter_sigma_mm is not None:
        return cell.sphere_diameter_sigma_mm
    return _SIGMAS_MM[cell.sphere_class or ASSUMED_CLASS]
