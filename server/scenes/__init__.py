"""Sessions as 3-D scenes: the only place that knows viser."""
