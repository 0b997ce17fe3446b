"""Calibration of laser scanning cells: pure functions from records and arrays to frozen results.

The packages follow the paper: `optics` (camera and laser plane), `sphere` (its centre in a scan), `chain`
(TCP, turntable, everything together), `fusion` (the merged cloud).  Lengths are millimetres and angles radians
unless a name says otherwise.
"""

__version__ = "0.1.0"
