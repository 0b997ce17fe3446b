"""The arm's errors as a UR's calibration has them: beside the one that its ROS driver draws, to compare alone."""

import numpy as np

from calib_core.arms.kinematics import arm_of
from calib_core.arms.ur_calibration import LINKS, calibration_frames
from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export, Settings
from calib_core.exports.neutral import position_and_quaternion, roll_pitch_yaw
from calib_core.exports.urdf_arm import arm_and_errors
from calib_core.exports.writing import provenance
from calib_core.frames import RigidTransform

_NUMBERS = ("x", "y", "z", "roll", "pitch", "yaw")


def _write(answer: Answer, settings: Settings) -> str:
    arm, errors = arm_and_errors(answer)
    frames, left_out = calibration_frames(arm_of(arm), errors)
    told = [
        *provenance(answer, of_arm=True),
        "To compare with the file that calibration_correction draws: the controller does not take it.",
        *(f"Not among them, as no calibration has it: {name} {errors[name]:.6g}" for name in left_out),
    ]
    lines = [*(f"# {line}" for line in told), "kinematics:"]
    for link, place in zip(LINKS, frames, strict=True):
        frame = RigidTransform.from_rounded(np.asarray(place).tolist(), "base", "tool0")
        numbers = [*position_and_quaternion(frame)[0], *roll_pitch_yaw(frame)]
        lines += [f"  {link}:", *(f"    {name}: {value}" for name, value in zip(_NUMBERS, numbers, strict=True))]
    return "\n".join([*lines, "  hash: scancell"]) + "\n"


EXPORT = Export(
    "ur-calibration", "YAML: a UR with its errors, to compare", "application/yaml", ".yaml", _write, comment="#"
)
