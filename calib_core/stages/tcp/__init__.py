"""The scanner's pose on the flange."""
