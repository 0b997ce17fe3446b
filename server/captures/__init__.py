"""Captures on their way in: received, measured, stored, changed."""
