"""The session that recognised files make: a capture a measurement, with its pose."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from calib_core.messages import message, sentences, templates
from calib_core.recognition.pairing import By
from calib_core.recognition.recognised import Recognised
from calib_core.recognition.taken import Look
from calib_core.records import Session, parse_session

_KINDS = {"profiles": "profile", "clouds": "cloud", "frames": "frame", "boards": "frame"}
_LASER = re.compile(r"laser|stripe|line(?!ar)|plane", re.IGNORECASE)
_NO_CONVENTION = "matrix"
_PAIRED: Mapping[By, str] = templates(
    {
        "name": "Measurements and poses were paired by their names.",
        "number": "Measurements and poses were paired by their numbers.",
        "time": "Measurements and poses were paired by their times.",
        "order": "Measurements and poses were paired by their order.",
    }
)


@dataclass(frozen=True)
class MadeSession:
    """A session, which file is copied where, and which capture each belongs to."""

    session: Session
    files: Mapping[str, str]
    capture_of: Mapping[str, str]
    notes: tuple[str, ...]


def session_of(found: Recognised, name: str, arm: str | None = None) -> MadeSession:
    """Return the session that recognised files make; what it lacks stands in `found.missing`."""
    captures: list[dict[str, Any]] = []
    files: dict[str, str] = {}
    capture_of: dict[str, str] = {}
    taken: set[str] = set()
    sigmas: list[float] = []
    for pair in found.pairs:
        if pair.file is None:
            continue
        look = found.looks[pair.file]
        record: dict[str, Any]
        if look.centers is not None and pair.point is not None:
            point = look.centers.points[pair.point]
            own = _free((point.name, f"{look.file.stem}-{point.name}"), taken)
            record = {"id": own, "step": "tcp", "kind": "center", "center_mm": list(point.center_mm)}
            sigmas += [look.centers.sigma_mm] if look.centers.sigma_mm else []
        else:
            own = _free((look.file.stem, look.file.name.rpartition(".")[0].replace("/", "-")), taken)
            ending = re.search(r"\.[A-Za-z0-9]{1,8}\Z", look.file.name)
            copy = f"captures/{own}{ending[0].lower() if ending else ''}"
            files[copy], capture_of[look.file.name] = look.file.name, own
            record = {"id": own, "step": _step(look), "kind": _KINDS[look.taken_for], "files": [copy]}
        if pair.pose is not None:
            row = found.poses[pair.pose]
            record |= {"pose": list(row.numbers), "source": f"{row.file}:{row.line}"}
            record |= {} if row.joints_deg is None else {"joints_deg": list(row.joints_deg)}
            record |= {} if row.time_s is None else {"device_time_s": row.time_s}
            record |= {} if row.table_deg is None else {"table_deg": row.table_deg}
            record |= {"step": "turntable"} if row.has_table else {}
        captures.append(record)
    cell: dict[str, Any] = {"pose_convention": found.choice.convention if found.choice else _NO_CONVENTION}
    if arm is not None:
        cell["robot"] = {"arm": arm}
    if found.sphere_mm is not None:
        cell["sphere_diameter_mm"] = found.sphere_mm
    kinds = {capture["kind"] for capture in captures}
    if len(kinds) == 1:
        cell["scanner"] = {"kind": kinds.pop()}
    if cell.get("scanner") == {"kind": "center"}:  # a tracker stands still, the robot carries its target
        cell["arrangement"] = "sphere-on-robot"
        cell["scanner"] |= {"point_sigma_mm": math.hypot(*sigmas) / len(sigmas) ** 0.5} if sigmas else {}
    record = {"format": "scancell-session/1", "name": name, "cell": cell, "captures": captures}
    return MadeSession(parse_session(record, "session.json"), files, capture_of, tuple(_notes(found)))


def _notes(found: Recognised) -> list[str]:
    notes: list[str] = []
    if found.choice is not None and found.choice.sure and found.poses:
        convention = message("The poses' convention is '{name}'.", name=found.choice.convention)
        notes.append(sentences([convention, found.choice.why]))
    if found.by is not None:
        notes.append(message(_PAIRED[found.by]))
    if any(pair.point is not None for pair in found.pairs):
        notes.append(
            message("The laser tracker stands still, and the robot carries its target (`sphere-on-robot`).")
        )
    if found.sphere_from:
        notes.append(
            message(
                "The sphere's diameter, {diameter_mm:g} mm, is from {name}.",
                diameter_mm=found.sphere_mm,
                name=found.sphere_from,
            )
        )
    return [*notes, *dict.fromkeys(note for look in found.looks for note in look.notes)]


def _step(look: Look) -> str:
    if look.taken_for == "boards":
        return "laser-plane" if _LASER.search(look.file.name) else "camera"
    return "tcp"


def _free(names: tuple[str, str], taken: set[str]) -> str:
    """Return a capture's id, of the first of two names that is free; with a number behind it where none is."""
    clean = ""
    for wanted in names:
        clean = re.sub(r"[^A-Za-z0-9._-]", "-", wanted).lstrip("._-")[:56] or "capture"
        if clean not in taken:
            break
    number = 1
    own = clean
    while own in taken:
        number += 1
        own = f"{clean}-{number}"
    taken.add(own)
    return own
