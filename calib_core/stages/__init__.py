"""The calibrations of the paper, one folder each, and the graph that they form."""
