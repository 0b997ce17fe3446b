"""One file looked at by its content: points, poses, a controller's, a certificate, something else."""

import math
import re
from typing import Any, cast

from calib_core.disk import is_system_file
from calib_core.errors import CalibrationError, InputError
from calib_core.formats.format import Unit
from calib_core.formats.opencv import point_nodes
from calib_core.formats.points import FORMATS
from calib_core.formats.points import recognise as format_of
from calib_core.formats.shared.text_style import looks_like_text
from calib_core.formats.shared.xml_file import is_gzip, unzipped
from calib_core.messages import message
from calib_core.recognition.json_poses import keys_of, parsed, poses_in_json, sphere_mm_in
from calib_core.recognition.number_rows import rows_in
from calib_core.recognition.pose_rows import joints_in, poses_in
from calib_core.recognition.taken import GivenFile, Look, PoseList, PoseRow, Reason, TakenFor, nothing, preview_of
from calib_core.recognition.tracker_points import HINT, centers_in
from calib_core.robots.compiled import compiled
from calib_core.robots.registry import BRANDS
from calib_core.robots.text import decoded

_LONG = re.compile(r"rows[>:] ?(\d{1,9})")
_NUMBERS = re.compile(r"[-+]?\d+\.\d*(?:[eE][-+]?\d+)?")
_MANY = 200
_TITLE = "OpenCV YAML or XML"

_IMAGES = (b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"BM", b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_OFFICE = (b"xl/worksheets", b"word/document", b"ppt/slides", b"content.xml")
_OWN = {"inputs_sha256", "method_revision", "tool0_from_laser", "base_from_turntable"}
_MOST_POSE_BYTES = 4_000_000
_SURE = 0.5
_LEAST_POINTS = 8

KINDS: dict[str, TakenFor] = {"profile": "profiles", "cloud": "clouds", "frame": "frames"}


def look_at(file: GivenFile, unit: Unit | None = None) -> Look:
    """Return what a file is by itself; what others beside it make of it comes later.

    `unit` is that of a tracker's points where their file states none.
    """
    if file.refused:
        return nothing(file.refused)
    if not file.data.strip() and file.whole:
        return nothing("empty")
    if is_system_file(file.name):
        return nothing("system")
    if (known := compiled(file.name, file.head)) is not None:
        return nothing("compiled", what=known[0], to_do=known[1])
    if file.data.startswith(b"PK\x03\x04"):
        return _zip(file)
    if file.head.startswith(_IMAGES):
        return Look("frames", Reason("picture"))
    if is_gzip(file.data):
        return _controllers(file, _unpacked(file)) or nothing("binary")
    if not looks_like_text(file.head) or _is_binary_format(file):
        return _binary(file)
    return _text(file, unit)


def _is_binary_format(file: GivenFile) -> bool:
    """Return whether a file begins like one of points in binary, with a header that is text: PLY, PCD."""
    return file.head.startswith((b"ply", b"# .PCD", b"VERSION"))


def _zip(file: GivenFile) -> Look:
    if any(mark in file.data for mark in _OFFICE):
        return nothing("office")
    if b"data/session.json" in file.data:
        return nothing("archive")
    return Look("backup", Reason("zip"), brand="zip")


def _unpacked(file: GivenFile) -> str:
    try:
        return decoded(unzipped(file.data, file.name))
    except InputError:
        return ""


def _binary(file: GivenFile) -> Look:
    try:
        entry, match = format_of(file.head, file.name)
    except InputError:
        return _controllers(file, decoded(file.head)) or nothing("binary")
    if match.sure < _SURE:
        return _controllers(file, decoded(file.head)) or nothing("binary")
    if entry.kinds == ("mesh",):
        return nothing("mesh")
    return _points(file, entry.name, entry.title, match.reason)


def _points(file: GivenFile, name: str, title: str, how: str) -> Look:
    entry = FORMATS.get(name)
    kind = next((k for k in entry.kinds if k in KINDS), "cloud")
    preview: tuple[tuple[float, float], ...] = ()
    if file.whole and entry.read is not None:
        try:
            reading = entry.read(file.data, file.name, entry.settings(), None)
            kind, preview = reading.kind, preview_of(reading.points)
        except CalibrationError as error:
            if len(entry.kinds) == 1:
                return Look(KINDS[kind], Reason("damaged", {"because": error.reason}))
    return Look(KINDS[kind], Reason("points", {"title": title, "how": how}), preview=preview)


def _text(file: GivenFile, unit: Unit | None) -> Look:
    text = decoded(file.head)
    begins = text.lstrip()[:1]
    if begins and begins in "{[":
        found = _json(file, text)
        if found is not None:
            return found
    if begins == "<" and "digitalCalibrationCertificate" in text:
        return Look("certificate", Reason("certificate"))
    if text.startswith("%YAML:1.0") or "<opencv_storage>" in text[:400]:
        return look_at_storage(file, text)
    if HINT.search(text) and (found := _centers(file, unit)) is not None:
        return found
    for step in (_listing, _controllers, _table):
        found = step(file, text)
        if found is not None:
            return found
    return nothing("text")


def _json(file: GivenFile, head: str) -> Look | None:
    if not file.whole or len(file.data) > _MOST_POSE_BYTES:
        return None
    data = parsed(decoded(file.data))
    if data is None:
        return None
    if isinstance(data, dict) and str(data.get("format", "")).startswith("scancell-session/"):
        return Look("session", Reason("session"))
    if isinstance(data, dict) and not _OWN.isdisjoint(cast("dict[str, Any]", data)):
        return nothing("result")
    poses = poses_in_json(data, file.name)
    if poses is not None:
        return _with_poses(poses[0], poses[1], sphere_mm_in(data), keys_of(data))
    sphere_mm = sphere_mm_in(data)
    if sphere_mm is not None:
        reason = Reason("settings-sphere", {"keys": keys_of(data), "sphere_mm": sphere_mm})
        return Look("nothing", reason, sphere_mm=sphere_mm)
    return nothing("settings", keys=keys_of(data))


def _with_poses(poses: PoseList, key: str = "", sphere_mm: float | None = None, keys: str = "") -> Look:
    whole = sum(all(map(math.isfinite, row.numbers)) for row in poses.rows)
    values: dict[str, str | float] = {"poses": whole, "numbers": len(poses.rows[0].numbers)}
    values |= {"key": key} if key else {}
    if len(poses.rows) == 1 and keys:  # one alone among settings: a result of theirs, unless a scan has its name
        values["keys"] = keys
    return Look("poses", Reason("poses-under" if key else "poses", values), poses=poses, sphere_mm=sphere_mm)


def _centers(file: GivenFile, told: Unit | None) -> Look | None:
    """Return a laser tracker's points."""
    if not file.whole or len(file.data) > _MOST_POSE_BYTES:
        return None
    centers = centers_in(decoded(file.data), file.name, told)
    if centers is None:
        return None
    count = len(centers.points)
    if centers.unit is None:
        return Look("centers", Reason("centers-unit", {"points": count}), centers=centers)
    values: dict[str, str | float] = {"points": count, "unit": centers.unit}
    if centers.sigma_mm:
        return Look("centers", Reason("centers-sure", {**values, "sigma_mm": centers.sigma_mm}), centers=centers)
    return Look("centers", Reason("centers", values), centers=centers)


def _listing(file: GivenFile, text: str) -> Look | None:
    """Return points of a scanner's own listing, which its first lines tell."""
    best = max(FORMATS, key=lambda entry: entry.recognise(file.head, file.name).sure)
    match = best.recognise(file.head, file.name)
    if match.sure <= _SURE or best.name == "opencv":
        return None
    return _points(file, best.name, best.title, match.reason)


def _controllers(file: GivenFile, text: str) -> Look | None:
    """Return what a controller wrote; what stands in it, its whole backup tells."""
    ending = f".{file.name.rpartition('.')[2].lower()}"
    know = [b for b in BRANDS if b.reads and b.name != "table" and b.recognises(text, file.name)]
    if not know:
        return None
    brand = next((b for b in know if ending in b.endings), know[0])
    values = {"brand": brand.title, "tools": 0, "frames": 0}
    return Look("backup", Reason("controller", values), brand=brand.name)


def _table(file: GivenFile, text: str) -> Look | None:
    cut = len(file.head) < len(file.data) or not file.whole
    found = rows_in(text if not cut else text[: text.rfind("\n") + 1])
    if not found.rows:
        return None
    poses = poses_in(found, file.name)
    if poses is not None and file.whole and len(file.data) <= _MOST_POSE_BYTES:
        if cut:
            poses = poses_in(rows_in(decoded(file.data)), file.name)
        if poses is not None:
            return _with_poses(poses)
    if joints := joints_in(found, file.name):
        return Look("nothing", Reason("joints-alone"), joints=joints)
    values = {"rows": len(found.rows), "columns": found.width}
    if found.width < 2 or len(found.rows) < _LEAST_POINTS or found.others > len(found.rows):
        return None
    kind, preview = _points_of_table(file, found.width)
    return Look(kind, Reason("table-begun" if cut else "table", values), preview=preview)


def _points_of_table(file: GivenFile, width: int) -> tuple[TakenFor, tuple[tuple[float, float], ...]]:
    """Return what the reader makes of a table of points; where it asks, two columns are a profile."""
    try:
        entry = format_of(file.head, file.name)[0]
    except InputError:
        entry = FORMATS.get("table")
    if file.whole and entry.read is not None:
        try:
            reading = entry.read(file.data, file.name, entry.settings(), None)
            return KINDS[reading.kind], preview_of(reading.points)
        except CalibrationError:
            pass
    return "profiles" if width == 2 else "clouds", ()


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
