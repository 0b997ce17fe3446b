"""The list of movers: those of this package, and those that other packages bring."""

from calib_core.registry import Registry
from server.movers.mover import MoverEntry

MOVERS = Registry("a mover", "server.movers", "MOVER", MoverEntry, "scancell.movers")
