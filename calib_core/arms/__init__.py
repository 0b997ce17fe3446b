"""Robot arms: where their joints put the flange."""
