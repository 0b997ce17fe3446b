"""E57 (ASTM E2807): clouds in metres, as the standard counts, with their poses; read by pye57."""

from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from calib_core.disk import temporary_folder
from calib_core.errors import InputError
from calib_core.formats.format import INTENSITY, Format, Match, PointKind, Reading, Settings, by_ending
from calib_core.formats.shared.binary_table import require_count
from calib_core.formats.shared.columns import points_of
from calib_core.formats.shared.e57_writing import cloud_pieces, pieces_of_scans
from calib_core.formats.shared.unnamed import Column
from calib_core.frames import FloatArray
from calib_core.messages import message

_TO_DO = message("Copy or export it again.")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")


class E57Settings(Settings):
    """As `Settings`; `scan` is the scan that is meant, from 0, where the file holds several."""

    scan: Annotated[int, Field(ge=0)] | None = None


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is E57."""
    return Match(1.0, "begins with ASTM-E57") if data[:8] == b"ASTM-E57" else by_ending(name, FORMAT.endings)


def read(data: bytes, name: str, settings: E57Settings, kind: PointKind | None) -> Reading:
    """Return the points of one scan, as its scanner saw them; raises InputError if it is damaged or cut off."""
    if data[:8] != b"ASTM-E57":
        raise InputError("an E57 file", "a file that does not begin like one", _TO_DO, name)
    try:
        import pye57
        from pye57.exception import PyE57Exception
    except ModuleNotFoundError:
        to_do = message("Install it: pip install 'scancell[e57]'; or export the cloud as PLY.")
        raise InputError("the extra '{extra}'", "none", to_do, name, extra="e57") from None
    with temporary_folder() as folder:  # libE57Format reads files alone
        path = folder / "scan.e57"
        path.write_bytes(data)
        try:
            with pye57.E57(str(path)) as opened:
                points, bright, posed = _scan(opened, len(data), settings, name)
        except InputError:
            raise
        except (
            PyE57Exception,
            pye57.libe57.E57Exception,
            ValueError,
            KeyError,
            RuntimeError,
            MemoryError,
        ) as error:
            got = " ".join(str(error).split())[:120] or type(error).__name__
            raise InputError("a whole E57 file", got, _TO_DO, name) from None
    columns = [Column(axis, place, f"cartesian{axis.upper()}", "m") for place, axis in enumerate("xyz")]
    reading = points_of(points, columns, kind, name, settings).with_intensity(bright)
    notes = ["The scan's pose in the file is not applied: points are in its scanner's frame."] if posed else []
    return replace(reading, unit_from="settings" if settings.unit else "format").adding(notes)


def scan_poses(data: bytes, name: str) -> list[list[float] | None]:
    """Return each scan's pose as rows of a 4×4 in mm, None where it has none; raises InputError as `read`."""
    try:
        import pye57
    except ModuleNotFoundError:
        to_do = message("Install it: pip install 'scancell[e57]'; or export the cloud as PLY.")
        raise InputError("the extra '{extra}'", "none", to_do, name, extra="e57") from None
    found: list[list[float] | None] = []
    with temporary_folder() as folder:
        path = folder / "scan.e57"
        path.write_bytes(data)
        try:
            with pye57.E57(str(path)) as opened:
                for number in range(int(opened.scan_count)):
                    header = opened.get_header(number)
                    pose = np.eye(4)
                    if header.node.isDefined("pose"):
                        pose[:3, :3] = header.rotation_matrix
                        pose[:3, 3] = 1000 * np.asarray(header.translation)
                    found.append(pose.ravel().tolist() if header.node.isDefined("pose") else None)
        except (pye57.libe57.E57Exception, ValueError, RuntimeError) as error:
            raise InputError("a whole E57 file", " ".join(str(error).split())[:120], _TO_DO, name) from None
    return found


def _scan(opened: Any, size: int, settings: E57Settings, where: str) -> tuple[FloatArray, Any, bool]:
    """Return a scan's points (N, 3) in its unit, NaN where invalid, intensities, and whether it has a pose."""
    scans = int(opened.scan_count)
    chosen = settings.scan if settings.scan is not None else 0
    if chosen >= scans or (scans > 1 and settings.scan is None):
        got = message("{scans} scans", scans=scans)
        raise InputError("one scan", got, "Give the setting scan, from 0, or export one alone.", where)
    header = opened.get_header(chosen)
    require_count(int(header.point_count), 8 * size, where)
    raw = opened.read_scan_raw(chosen, ignore_unsupported_fields=True)  # normals, as an extension has them
    if all(f"cartesian{axis}" in raw for axis in "XYZ"):
        points = np.column_stack([raw[f"cartesian{axis}"] for axis in "XYZ"]).astype(np.float64)
        invalid = raw.get("cartesianInvalidState")
    elif all(name in raw for name in _SPHERICAL):
        distance, azimuth, elevation = (raw[name] for name in _SPHERICAL)
        flat = distance * np.cos(elevation)
        points = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), distance * np.sin(elevation)])
        invalid = raw.get("sphericalInvalidState")
    else:
        raise InputError("cartesian or spherical coordinates", f"{', '.join(raw)[:80]}", _TO_DO, where)
    if invalid is not None:
        points[np.asarray(invalid) != 0] = np.nan
    return points, raw.get(INTENSITY), bool(header.node.isDefined("pose"))


FORMAT = Format(
    name="e57",
    title="E57 (ASTM E2807)",
    endings=(".e57",),
    kinds=("cloud",),
    recognise=recognise,
    read=read,
    settings=E57Settings,
    scan_poses=scan_poses,
    media_type="model/e57",
    write_cloud=cloud_pieces,
    write_scans=pieces_of_scans,
    proof="real files",
)
