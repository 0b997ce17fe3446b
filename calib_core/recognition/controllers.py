"""Controllers' files among others: read together, brand by brand, each named for what it holds."""

from collections.abc import Sequence
from dataclasses import replace

from calib_core.errors import CalibrationError
from calib_core.recognition.taken import Look, PoseList, PoseRow, Reason, nothing
from calib_core.robots.backup import read_controller_files
from calib_core.robots.controller_file import ControllerFile, FilePose
from calib_core.robots.file_hints import Told
from calib_core.robots.registry import BRANDS


def read_together(looks: Sequence[Look], arm: str | None = None) -> dict[int, Look]:
    """Return what each of these files is, by its place; a known arm tells joints of poses."""
    found: dict[int, Look] = {}
    brands = dict.fromkeys(look.brand for look in looks)
    for brand in brands:
        own = {k: look for k, look in enumerate(looks) if look.brand == brand}
        if brand == "zip":
            for k, look in own.items():
                found |= _read({k: look}, None, arm)
        else:
            found |= _read(own, brand, arm)
    return found


def _read(looks: dict[int, Look], brand: str | None, arm: str | None) -> dict[int, Look]:
    try:
        files = {look.file.name: look.file.data for look in looks.values()}
        read = read_controller_files(files, brand, told=Told(arm=arm))
    except CalibrationError as error:
        if brand is None:
            return {k: replace(nothing("zip"), file=look.file) for k, look in looks.items()}
        values = {"brand": BRANDS.get(brand).title, "because": error.reason}
        return {k: replace(nothing("controller-unread", **values), file=look.file) for k, look in looks.items()}
    title = BRANDS.get(read.brand).title
    return {k: _look(look, read, title, brand is None, arm is not None) for k, look in looks.items()}


def _look(look: Look, read: ControllerFile, title: str, packed: bool, told_arm: bool) -> Look:
    name = look.file.name
    poses = [pose for pose in read.poses if packed or pose.file == name]
    tools = sum(packed or frame.file == name for frame in read.tools)
    frames = sum(packed or frame.file == name for frame in read.frames)
    rows = [_row(pose) for pose in poses if pose.pose is not None]
    if rows:
        values = {"brand": title, "poses": len(rows), "tools": tools, "frames": frames}
        reason, listed = Reason("controller-poses", values), PoseList(tuple(rows), (poses[0].convention,))
        notes = read.notes if told_arm else ()
        return replace(look, taken_for="poses", reason=reason, poses=listed, notes=notes)
    skipped = [row for row in read.skipped if packed or row.file == name]
    values = {"brand": title, "tools": tools, "frames": frames}
    reason = Reason("controller", values)
    if skipped:
        reason = Reason("controller-skipped", {**values, "because": skipped[0].reason})
    return replace(look, taken_for="backup", reason=reason, poses=None)


def _row(pose: FilePose) -> PoseRow:
    external = list((pose.external or {}).items())
    table_deg = next((value for axis, value in external if axis == "table"), None)
    return PoseRow(
        pose.pose or (),
        pose.line,
        pose.name,
        None,
        pose.time_s,
        pose.file,
        pose.joints_deg,
        table_deg,
        has_table=table_deg is not None,
        doubt=pose.doubt,
    )
