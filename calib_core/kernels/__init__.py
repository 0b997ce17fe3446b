"""The few hot loops, compiled by numba; imported late."""
