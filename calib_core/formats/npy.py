"""NPY: arrays of points (N, 2), (N, 3), organised ones (H, W, 3), heights (H, W), and records with fields."""

from dataclasses import replace

from calib_core.errors import InputError
from calib_core.formats.format import Format, Match, PointKind, Reading, by_ending
from calib_core.formats.shared.binary_table import parse_npy
from calib_core.formats.shared.columns import TableSettings, reading_of_values
from calib_core.formats.shared.heights import HeightSettings, grid_of
from calib_core.messages import message


class NpySettings(HeightSettings, TableSettings):
    """As for a table of points, and as for a grid of heights."""


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is NPY."""
    return Match(1.0, "begins like one") if data[:6] == b"\x93NUMPY" else by_ending(name, FORMAT.endings)


def read(data: bytes, name: str, settings: NpySettings, kind: PointKind | None) -> Reading:
    """Return the points of an NPY file; never unpickles.  Raises InputError with the shape that does not fit."""
    array, names = parse_npy(data, name)
    need = message("an NPY file of N×2 numbers (a profile), N×3 or H×W×3 (a cloud), or H×W heights")
    if array.ndim == 3 and array.shape[2] in (2, 3, 4):
        rows, columns, width = array.shape
        reading = reading_of_values(array.reshape(-1, width), names, name, settings, kind)
        organised = min(rows, columns) > 1 and reading.kind == "cloud"
        return replace(reading, grid=(rows, columns)) if organised else reading
    if array.ndim == 2 and (names or (array.shape[1] in (2, 3, 4) and settings.x_pitch_mm is None)):
        return reading_of_values(array, names, name, settings, kind)
    if array.ndim == 2 and min(array.shape) > 1 and kind != "profile":
        return grid_of(array, settings, name)
    to_do = "Save it with numpy.save in one of these."
    raise InputError(need, "an array of shape {shape}", to_do, name, shape=array.shape)


FORMAT = Format(
    name="npy",
    title="NumPy array (NPY)",
    endings=(".npy",),
    kinds=("profile", "cloud"),
    recognise=recognise,
    read=read,
    settings=NpySettings,
    proof="real files",
)
