"""Files that do not give findings yet, which shrink to nothing; whoever converts one takes it out of here."""

VERDICTS: set[str] = {
    "calib_core/captures/figures.py",
    "calib_core/captures/measure.py",
    "calib_core/captures/measure_frame.py",
    "calib_core/captures/sweep_sphere.py",
    "calib_core/exports/answer.py",
    "calib_core/exports/export.py",
    "calib_core/records/faults.py",
    "calib_core/stages/camera/solve.py",
    "calib_core/stages/laser_plane/solve.py",
    "calib_core/stages/verify/decision.py",
    "calib_core/stages/verify/solve.py",
    "server/captures/measuring_queue.py",
    "server/measuring.py",
    "server/store/calibrations.py",
    "server/store/history.py",
}
"""Files in which a verdict is set or raised by hand."""

SENTENCES: set[str] = {
    "calib_core/evidence/text.py",
    "calib_core/formats/gocator.py",
    "calib_core/stages/camera/solve.py",
    "calib_core/stages/laser_plane/solve.py",
    "server/http/errors.py",
    "server/sources/folder.py",
}
"""Files that look into sentences to decide something."""
