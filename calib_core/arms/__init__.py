"""Robot arms: where their joints put the flange, and what their errors look like."""
