"""The list of robot brands, and of those that other packages bring."""

from calib_core.registry import Registry
from calib_core.robots.brand import Brand

BRANDS = Registry("a robot brand", "calib_core.robots", "BRAND", Brand, "scancell.brands")
