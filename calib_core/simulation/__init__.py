"""Scanning cells with known truth: their own forward model, which shares no code with the solvers."""
