"""CSV: one row a frame, position in mm and quaternion, with standard deviations."""

import csv
import io

import numpy as np

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export
from calib_core.exports.neutral import FrameSettings, edges_known, position_and_quaternion
from calib_core.exports.writing import provenance

_NAMES = ["parent", "child", "x_mm", "y_mm", "z_mm", "qx", "qy", "qz", "qw"]
_SIGMAS = ["sigma_rx_rad", "sigma_ry_rad", "sigma_rz_rad", "sigma_x_mm", "sigma_y_mm", "sigma_z_mm"]


def _write(answer: Answer, settings: FrameSettings) -> str:
    text = io.StringIO()
    text.writelines(f"# {line}\n" for line in provenance(answer))
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow([*_NAMES, *_SIGMAS])
    for parent, child, frame, covariance in edges_known(answer, settings):
        sigmas = np.sqrt(np.maximum(np.diag(covariance), 0)).tolist() if covariance is not None else [""] * 6
        position = [repr(float(v)) for v in frame.translation_mm]
        rows.writerow([parent, child, *position, *position_and_quaternion(frame)[1], *sigmas])
    return text.getvalue()


EXPORT = Export(
    "csv", "CSV: one row a frame", "text/csv", ".csv", _write, FrameSettings, proof=None, open_too=True
)
