"""Scans merged into one cloud."""
