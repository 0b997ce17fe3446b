"""The calibrated tool frame for other programs."""

import json
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np
from pydantic import ValidationError

from calib_core.archive.folder import result_data
from calib_core.archive.stored_clouds import media_types
from calib_core.cell.found import SCANNER_FRAMES, placed_table, scanner_answered, scanner_frame, table_seen
from calib_core.errors import InputError
from calib_core.exports.answer import Answer, answer_of
from calib_core.exports.entry import Export, Settings
from calib_core.exports.registry import all_exports, export_named
from calib_core.exports.writing import marked
from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import message
from calib_core.poses.conventions import CONVENTIONS
from calib_core.poses.numbers import to_pose
from calib_core.records import Record, ResultsData, Session
from calib_core.records.faults import OF_RESULTS
from calib_core.records.field_errors import input_error
from calib_core.steps import table_stages

POSES: Final = "poses"
"""The setting of every export that says with which poses it will be used: "controller" or "corrected"."""

_ORDER = ("rx_rad", "ry_rad", "rz_rad", "tx_mm", "ty_mm", "tz_mm")
_STEP_RAD, _STEP_MM = 1e-5, 1e-2


def export(
    session: Session,
    results: Mapping[str, Record | Mapping[str, Any]],
    name: str,
    stale: Collection[str] = (),
    allow: Collection[str] = OF_RESULTS,
    settings: Mapping[str, Any] | None = None,
    backup: bytes | None = None,
    date: str = "",
) -> tuple[bytes, Export]:
    """Return the answer in an export's syntax, and the export's entry.

    Parameters
    ----------
    session : Session
    results : mapping
        The stages' results by stage, as records or as their JSON data.
    name : str
        As in `all_exports`.
    stale : collection of str
        The stages whose results are stale.
    allow : collection of str
        The faults (`records.faults`) in spite of which it is exported.
    settings : mapping, optional
        The export's settings, and `poses`, "controller" (left out) or "corrected": with which poses it will be
        used, where the arm's errors were taken out of those of the captures.
    backup : bytes, optional
        A controller's own file: one entry of it is changed.
    date : str, optional
        When the answer was solved.

    Raises
    ------
    InputError
        If the format or a setting is unknown, or the backup is not one that it can change.
    ConflictError
        If nothing is solved yet, or the answer has faults that are not allowed.
    """
    export_named(name, tuple(media_types()))  # that there is no such format comes first
    return write_export(answer_of(session, results, stale, date), name, allow, settings, backup)


def write_export(
    answer: Answer,
    name: str,
    allow: Collection[str] = (),
    settings: Mapping[str, Any] | None = None,
    backup: bytes | None = None,
) -> tuple[bytes, Export]:
    """Return an answer in an export's syntax, and the export's entry; parameters and errors as of `export`."""
    entry = export_named(name, tuple(media_types()))
    answer.require_usable(allow)
    told = dict(settings or {})
    answer = for_poses(answer, told.pop(POSES, "controller"))
    try:
        chosen = entry.settings.model_validate(told)
    except ValidationError as error:
        raise input_error(error, settings, message("settings of '{name}'", name=name)) from None
    if not entry.open_too:
        answer.require_placed()
    answer = answer.of_scanner(getattr(chosen, "of_scanner", None))
    if backup is None:
        content = marked(entry.write(answer, chosen), answer, entry)
    elif entry.patch is None:
        able = ", ".join(e.name for e in all_exports() if e.patch)
        to_do = "Name one of these."
        raise InputError("an export that can change a backup: {able}", f"'{name}'", to_do, "into", able=able)
    else:
        content = entry.patch(backup, answer, chosen)
    return (content.encode() if isinstance(content, str) else content), entry


def frames_json(answer: Answer, settings: Settings) -> str:
    """Return tool and table in every convention, with their uncertainty, as JSON."""
    results = answer.results
    frames = tool_frame(answer.session, results[answer.stage]) | table_frames(results)
    frames |= {"verdict": answer.verdict, "stale": answer.stale}
    if answer.faults:
        frames["not_to_be_used"] = list(answer.faults)
    if answer.of_moment:
        frames["attention"] = list(answer.of_moment)
    return json.dumps(frames, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def tool_frame(session: Session, result: Mapping[str, Any]) -> dict[str, Any]:
    """Return the scanner's frame in every pose convention, with its uncertainty, as JSON data.

    Of a table that is known to its scanner alone it is the table's, in the scanner's.
    """
    if (seen := table_seen(result)) is not None:
        frame = RigidTransform.from_rounded(seen.matrix, "laser", "turntable")
        name, maps = "laser_from_turntable", "the turntable's frame into the scanner's"
        matrix, covariance = seen.matrix, np.array(seen.covariance, dtype=float)
    else:
        frame, covariance = scanner_answered(result)
        mount = "the flange's" if frame.into == "tool0" else "base"
        name, maps = f"{frame.into}_from_laser", f"the scanner's frame into {mount}"
        matrix = result.get(name, frame.to_rows())
    sigmas = np.sqrt(np.diag(covariance)[:6])
    return {
        "format": "scancell-tool/1",
        "session": session.name,
        "stage": result["stage"],
        "verdict": result["verdict"],
        "warnings": result["warnings"],
        "software": result["software"],
        "inputs_sha256": result["inputs_sha256"],
        "frame": f"{name}: maps points of {maps}, mm",
        name: matrix,
        "covariance": [[value if np.isfinite(value) else None for value in row] for row in covariance.tolist()],
        "covariance_order": list(_ORDER),
        "standard_deviation": {k: v if np.isfinite(v) else None for k, v in zip(_ORDER, sigmas, strict=True)},
        "confidence_95": result.get("confidence_95", {}),
        "undetermined": result.get("undetermined", []),
        "frames": result.get("frames", []),
        "pose_convention": session.cell.pose_convention,
        **_used({} if seen else result, frame, covariance),
    }


_TABLE_FIELDS = (
    "verdict", "inputs_sha256", "base_from_turntable", "axis_direction_in_base", "axis_point_in_base_mm",
    "direction", "axis_direction_sigma_deg", "axis_point_sigma_mm", "mounts", *SCANNER_FRAMES,
    "covariance", "turntable_covariance",
)  # fmt: skip


def table_frames(results: Mapping[str, Record | Mapping[str, Any]]) -> dict[str, Any]:
    """Return the turntable's frame, and tool and turntable of the whole chain, where they are solved.

    `conventions` write base_from_turntable as each controller writes a user frame.

    A table belongs together with the tool beside it: that of `turntable` with the tcp stage's, that of `chain`
    with the chain's own.
    """
    found: dict[str, Any] = {}
    for stage in reversed(table_stages()):
        result = results.get(stage)
        if result is not None:
            data = result_data(result) if isinstance(result, Record) else result
            found[stage] = {name: data[name] for name in _TABLE_FIELDS if name in data}
            frame = placed_table(data)
            covariance = np.array(data.get("turntable_covariance") or data["covariance"], dtype=float)
            found[stage] |= _used(data, frame, covariance)
            if stage == "chain":
                tool = scanner_frame(data)
                own = np.array(data["covariance"], dtype=float)
                if not data.get("up_to_shift"):
                    found[stage]["tool_conventions"] = {n: _in_convention(n, tool, own) for n in CONVENTIONS}
    return found


def tool_numbers(convention: str, frame: RigidTransform) -> list[float]:
    """Return a tool or user frame as a controller's numbers: it is written like any pose."""
    return to_pose(convention, RigidTransform(frame.matrix, "base", "tool0"))


def tool_number_sigmas(convention: str, tool: RigidTransform, covariance: FloatArray) -> list[float]:
    """Return the standard deviations of a tool frame's numbers, in their units.

    The covariance (6, 6) of rx ry rz tx ty tz is carried over by the numbers' derivatives (central differences).
    """
    steps = np.array([_STEP_RAD] * 3 + [_STEP_MM] * 3)
    columns: list[FloatArray] = []
    for k, step in enumerate(steps):
        xi = np.zeros(6)
        xi[k] = step
        ahead = np.array(tool_numbers(convention, tool.perturbed(xi)))
        behind = np.array(tool_numbers(convention, tool.perturbed(-xi)))
        difference = ahead - behind
        if CONVENTIONS[convention].form in ("ZYX", "XYZ", "ZYZ"):
            difference[3:] = (difference[3:] + 180) % 360 - 180  # angles jump at ±180°
        columns.append(difference / (2 * step))
    jacobian = np.stack(columns, axis=1)
    # A table's frame has five degrees of freedom: a variance of zero may come out a rounding error below it.
    variances = np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian)
    return np.sqrt(np.maximum(variances, 0.0)).tolist()


def _used(result: Mapping[str, Any], frame: RigidTransform, covariance: FloatArray) -> dict[str, Any]:
    """Return a frame in every convention; where its position is open, what holds of scanner and table together."""
    if result.get("up_to_shift"):
        return {"up_to_shift": result["up_to_shift"]}
    return {"conventions": {name: _in_convention(name, frame, covariance[:6, :6]) for name in CONVENTIONS}}


def _in_convention(name: str, tool: RigidTransform, covariance: FloatArray) -> dict[str, Any]:
    convention = CONVENTIONS[name]
    return {
        "names": convention.numbers.split(),
        "numbers": tool_numbers(name, tool),
        "standard_deviations": tool_number_sigmas(name, tool, covariance),
        "units": convention.units,
        "formula": convention.formula,
        "controllers": convention.brands,
    }


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
