"""The few hot loops, compiled by numba; imported late."""

from calib_core.compiled import set_up

set_up()
