"""What every request passes: errors, limits, headers, time-outs."""
