"""The answer for a controller that knows nothing of corrected poses: the one that is best with its own."""

from dataclasses import replace
from typing import Final

import numpy as np

from calib_core.errors import InputError
from calib_core.exports.answer import Answer
from calib_core.frames import RigidTransform
from calib_core.records import ResultsData

POSES: Final = "poses"
"""The setting of every export that says with which poses it will be used: "controller" or "corrected"."""


def for_poses(answer: Answer, poses: str) -> Answer:
    """Return an answer whose frames are the best with such poses; raises InputError where there are none such."""
    if poses not in ("controller", "corrected"):
        to_do = "Name one of these."
        raise InputError("poses 'controller' or 'corrected'", "'{poses}'", to_do, POSES, poses=poses)
    model = answer.results.get(answer.stage, {}).get("arm_model")
    if poses == "corrected" or not model or not model.get("applied"):
        return answer
    found = dict(answer.results[answer.stage])
    found["arm_model"] = {**model, "applied": False}
    found["frames"] = [f for f in found.get("frames") or () if f["outof"] not in ("laser", "turntable")]
    for frame in model.get("controller") or ():
        into, outof, covariance = frame["into"], frame["outof"], np.array(frame["covariance"], dtype=float)
        found[f"{into}_from_{outof}"] = frame["matrix"]
        found["frames"].append(frame)
        if outof == "turntable":
            table = RigidTransform.from_rounded(frame["matrix"], "base", "turntable")
            answer = replace(answer, base_from_turntable=table, table_covariance=covariance)
            found["turntable_covariance"] = frame["covariance"]
        else:
            tool = RigidTransform.from_rounded(frame["matrix"], into, "laser")
            answer = replace(answer, mount_from_laser=tool, tool_covariance=covariance)
            found["covariance"] = frame["covariance"]
    results: ResultsData = {**answer.results, answer.stage: found}
    return replace(answer, results=results)
