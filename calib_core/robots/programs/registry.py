"""The list of dialects, and of those that other packages bring."""

from calib_core.registry import Registry
from calib_core.robots.programs.program import Program

PROGRAMS = Registry("a robot program", "calib_core.robots.programs", "PROGRAM", Program, "scancell.robot_programs")
