"""The calibrations of the paper and what is made with them, one folder each."""
