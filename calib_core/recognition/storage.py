"""OpenCV's YAML and XML: profiles under any key and shape, or matrices that are poses."""

import re

from calib_core.errors import CalibrationError
from calib_core.formats.opencv import point_nodes
from calib_core.messages import message
from calib_core.recognition.taken import GivenFile, Look, PoseList, PoseRow, Reason, nothing, preview_of
from calib_core.robots.text import decoded

_LONG = re.compile(r"rows[>:] ?(\d{1,9})")
_NUMBERS = re.compile(r"[-+]?\d+\.\d*(?:[eE][-+]?\d+)?")
_MANY = 200
_TITLE = "OpenCV YAML or XML"


def look_at_storage(file: GivenFile, head: str) -> Look:
    """Return what OpenCV's file holds: points, poses of matrices, or other results."""
    if not file.whole:
        if max((int(n) for n in _LONG.findall(head)), default=0) > 4 or len(_NUMBERS.findall(head)) > _MANY:
            return Look("profiles", Reason("points", {"title": _TITLE, "how": "a long list of numbers"}))
        return nothing("settings", keys=_TITLE)
    text = decoded(file.data)
    try:
        nodes = point_nodes(text, file.name)
    except CalibrationError as error:
        return nothing("damaged", because=error.reason)
    if nodes:
        name, points = next(iter(nodes.items()))
        how = message("{count} points under {key}", count=len(points), key=name)
        kind = "profiles" if points.shape[1] == 2 else "clouds"
        return Look(kind, Reason("points", {"title": _TITLE, "how": how}), preview=preview_of(points))
    poses = _poses(file)
    if poses is not None:
        values = {"poses": len(poses.rows), "numbers": 16}
        return Look("poses", Reason("poses", values), poses=poses)
    return nothing("settings", keys=_TITLE)


def _poses(file: GivenFile) -> PoseList | None:
    from calib_core.robots.file_hints import Told
    from calib_core.robots.table.opencv import find

    try:
        found = find(file.data, file.name, Told(unit="mm"))
    except CalibrationError:
        return None
    rows = [
        PoseRow(taught.numbers, taught.line, taught.name, file=file.name, doubt=taught.doubt)
        for taught in found.poses
        if taught.numbers is not None
    ]
    return PoseList(tuple(rows), ("matrix",)) if rows else None
