"""Scans into one cloud: cleaning on the scan's own grid, voxel fusion, overlap, fine registration, mesh."""
