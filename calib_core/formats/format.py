"""What a file format is, and what reading a file gives: points, and what was taken for what.

Another package adds a format by an entry point of the group ``scancell.formats`` that names a `Format`.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, ConfigDict, Field

from calib_core.errors import InputError
from calib_core.formats.shared.mesh import MeshData
from calib_core.frames import FloatArray, finite_rows
from calib_core.messages import message
from calib_core.proof import Proof, is_experimental
from calib_core.records.base import Finite, Record, mismatch

Kind = Literal["profile", "cloud", "frame", "mesh"]
PointKind = Literal["profile", "cloud"]
Unit = Literal["m", "cm", "mm", "um", "in"]

MM_PER_UNIT: dict[Unit, float] = {"m": 1000.0, "cm": 10.0, "mm": 1.0, "um": 0.001, "in": 25.4}

Pieces = Iterator[bytes | memoryview]

Tables = Callable[[], Iterable[NDArray[Any]]]
"""Gives a cloud's tables from the beginning each time that it is called."""

_LEAST_SCALE = 1e-12

SCAN_COLUMN: Final = "scan"
"""The number of the scan that weighs most around a point; −1 where none does."""

INTENSITY: Final = "intensity"
"""How bright a point came back, in the scanner's own unit; NaN where that is not known."""


@dataclass(frozen=True, eq=False)
class ScanPlace:
    """A scan of a merged cloud: its name, and where (4, 4) its scanner stood."""

    name: str
    cloud_from_scan: FloatArray


def _not_zero(scale: float) -> float:
    if abs(scale) < _LEAST_SCALE:
        raise mismatch(message("a factor that is not zero"), f"{scale:g}", message("Correct it."))
    return scale


Scale = Annotated[Finite, AfterValidator(_not_zero)]


class Settings(Record):
    """What a user may say about a file that does not say it itself; all may be left out.

    `unit` is that of the file's coordinates.  `missing` lists values that stand where nothing came back, beside
    blanks and NaN.  `x_scale`, `y_scale` and `z_scale` multiply the coordinates of a scanner whose own are off, or
    by −1 mirrored.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    unit: Unit | None = None
    missing: list[Finite] = Field(default_factory=list)
    x_scale: Scale = 1.0
    y_scale: Scale = 1.0
    z_scale: Scale = 1.0


class Match(NamedTuple):
    """How sure a format is that a file is its own, 0 … 1, and why."""

    sure: float
    reason: str


NO_MATCH = Match(0.0, "")

_UNIT_FROM: Final = {
    "assumed": message("assumed"),
    "header": message("stated in the file"),
    "settings": message("as told"),
    "format": message("by the format"),
}
_KINDS: Final = {"profile": message("profile"), "cloud": message("cloud")}


@dataclass(frozen=True, eq=False)
class Reading:
    """The points of a file, and what was taken for what.

    Parameters
    ----------
    kind : "profile" or "cloud"
    points : (N, 2) or (N, 3)
        x and z of a profile, x, y and z of a cloud, in L and in mm; NaN where nothing came back.
    columns : dict
        For each axis what it was in the file: "X [mm]", "column 2".
    unit : str
        The unit of the file's coordinates.
    unit_from : str
        Who says so: "header", "settings", "format", or "assumed".
    grid : (rows, columns), optional
        Of an organised cloud: `points` holds its rows one after the other.
    notes, doubts : tuple of str
        Sentences: what a reader should know; why the file should be looked at before it is used.
    format : str
        The name of the format.
    intensity : (N,) float32 or None
        How bright each point came back, in the file's own unit.
    """

    kind: PointKind
    points: FloatArray
    columns: dict[str, str] = field(default_factory=dict[str, str])
    unit: str = "mm"
    unit_from: str = "assumed"
    grid: tuple[int, int] | None = None
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    format: str = ""
    intensity: NDArray[np.float32] | None = None

    @property
    def axes(self) -> str:
        """The axes of the points in their order."""
        return "xz" if self.kind == "profile" else "xyz"

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """Which rows (N,) are points: all their coordinates came back."""
        return finite_rows(self.points)

    @property
    def missing(self) -> int:
        """How many rows are none."""
        return int(len(self.points) - self.known.sum())

    @property
    def sure(self) -> Literal["stated", "usual", "doubtful"]:
        """Whether the file itself states columns and unit, has them as is usual, or leaves a doubt."""
        if self.doubts:
            return "doubtful"
        named = all(not name.startswith("column ") for name in self.columns.values())
        return "stated" if named and self.unit_from != "assumed" else "usual"

    def scaled(self, settings: Settings) -> "Reading":
        """Return the same reading with its points multiplied as the settings say."""
        scales = {axis: getattr(settings, f"{axis}_scale") for axis in self.axes}
        if all(scale == 1 for scale in scales.values()):
            return self
        said = ", ".join(
            message("{axis} by {scale:g}", axis=axis, scale=scale) for axis, scale in scales.items() if scale != 1
        )
        points = self.points * list(scales.values())
        return replace(self, points=points).adding([message("Multiplied as told: {said}.", said=said)])

    def with_intensity(self, intensity: NDArray[Any] | None) -> "Reading":
        """Return the same reading with how bright its points came back, where that is told and not all alike."""
        if intensity is None or not (known := intensity[np.isfinite(intensity)]).size or np.ptp(known) == 0:
            return self
        return replace(self, intensity=np.ascontiguousarray(intensity, dtype=np.float32))

    def adding(self, notes: Iterable[str] = (), doubts: Iterable[str] = ()) -> "Reading":
        """Return the same reading with further notes and doubts."""
        return replace(self, notes=(*self.notes, *notes), doubts=(*self.doubts, *doubts))

    def sentence(self) -> str:
        """Return in one line what was read."""
        kind = _KINDS.get(self.kind, self.kind)
        read = [message("{kind} of {count} points", kind=kind, count=len(self.points))]
        read += [f"{self.grid[0]} × {self.grid[1]}"] if self.grid else []
        read += [message("{count} without a value", count=self.missing)] if self.missing else []
        read += [f"{axis} = {name}" for axis, name in self.columns.items()]
        return message(
            "{format}: {read:,}; {unit} ({origin})",
            format=self.format,
            read=read,
            unit=self.unit,
            origin=_UNIT_FROM.get(self.unit_from, self.unit_from),
        )

    def to_json(self, rows: int = 400) -> dict[str, Any]:
        """Return what was taken, with at most so many of the points for drawing."""
        known = self.points[self.known]
        chosen = np.unique(np.linspace(0, len(known) - 1, min(len(known), rows)).astype(int)) if len(known) else []
        return {
            "format": self.format,
            "kind": self.kind,
            "points": len(self.points),
            "missing": self.missing,
            "grid": list(self.grid) if self.grid else None,
            "columns": self.columns,
            "unit": self.unit,
            "unit_from": self.unit_from,
            "sure": self.sure,
            "notes": list(self.notes),
            "doubts": list(self.doubts),
            "sentence": self.sentence(),
            "low_mm": known.min(axis=0).tolist() if len(known) else None,
            "high_mm": known.max(axis=0).tolist() if len(known) else None,
            "preview": np.round(known[chosen], 4).tolist(),
        }


@dataclass(frozen=True)
class Format:
    """One format: how to know a file of it, how to read it, how to write it.

    Parameters
    ----------
    name : str
        What users write, in lower case: "ply".
    title : str
        What people read: "PLY (ascii, binary)".
    endings : tuple of str
        Of its files, with the dot, in lower case.
    kinds : tuple of str
        What its files can hold.
    recognise : callable
        ``recognise(data, name)`` gives a `Match`; above 0.5 by content, below by the name's ending alone.
    read : callable, optional
        ``read(data, name, settings, kind)`` gives a `Reading`; `kind` is what the caller needs, None for either.
        Raises InputError with the line or the column that is at fault.
    settings : type
        The record of what a user may say about a file; a subclass of `Settings`.
    media_type : str
        Of what is written.
    read_mesh : callable, optional
        ``read_mesh(data, name)`` gives a `MeshData`; raises InputError.
    write_cloud : callable, optional
        ``write_cloud(tables, count, names)`` gives the file's bytes in pieces, of tables (N, K) float32, or
        float64 far from zero, with `count` rows in all; the first three columns are x, y, z in mm.
    write_scans : callable, optional
        ``write_scans(tables, names, scans)`` gives a merged cloud by its scans: `tables` is called for each
        pass, `scans` are those that the column `scan` numbers.
    write_mesh : callable, optional
        ``write_mesh(corners, blocks, count)``: corners (N, 3) in mm, blocks (M, 3) of indices, `count` in all.
    proof : Proof
        What proved its reader.
    scan_poses : callable, optional
        ``scan_poses(data, name)`` gives each scan's pose as rows of a 4×4 in mm, None where it has none; the
        setting `scan` then chooses one.
    """

    name: str
    title: str
    endings: tuple[str, ...]
    kinds: tuple[Kind, ...]
    recognise: Callable[[bytes, str], Match]
    read: Callable[[bytes, str, Any, PointKind | None], Reading] | None = None
    settings: type[Settings] = Settings
    media_type: str = "application/octet-stream"
    read_mesh: Callable[[bytes, str], MeshData] | None = None
    write_cloud: Callable[[Iterable[NDArray[Any]], int, tuple[str, ...]], Pieces] | None = None
    write_scans: Callable[[Tables, tuple[str, ...], Sequence[ScanPlace]], Pieces] | None = None
    write_mesh: Callable[[NDArray[Any], Iterable[NDArray[Any]], int], Pieces] | None = None
    proof: Proof = "manual only"
    scan_poses: Callable[[bytes, str], list[list[float] | None]] | None = None

    def to_json(self) -> dict[str, Any]:
        """Return what page and clients need to know, with the JSON Schema of the settings."""
        return {
            "name": self.name,
            "title": self.title,
            "endings": list(self.endings),
            "kinds": list(self.kinds),
            "reads": self.read is not None or self.read_mesh is not None or "frame" in self.kinds,
            "writes": [*(["cloud"] if self.write_cloud else []), *(["mesh"] if self.write_mesh else [])],
            "proof": self.proof,
            "experimental": is_experimental(self.proof),
            "settings": self.settings.model_json_schema(),
        }


def by_ending(name: str, endings: Sequence[str], sure: float = 0.3) -> Match:
    """Return a match for a file's ending alone."""
    ending = ending_of(name)
    return Match(sure, message("its name ends in {ending}", ending=ending)) if ending in endings else NO_MATCH


def ending_of(name: str) -> str:
    """Return the ending of a file's name in lower case, with the dot."""
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    return f".{last.rsplit('.', 1)[1].lower()}" if "." in last.lstrip(".") else ""


def require_kind(kind: PointKind, wanted: PointKind | None, where: str, columns: str) -> None:
    """Refuse a file that holds the other kind of points; raises InputError."""
    if wanted is not None and kind != wanted:
        raise InputError(
            "a profile (x and z)" if wanted == "profile" else "a cloud (x, y and z)",
            "a {has} with {columns}",
            "Give the capture the kind '{has}', or export the file as a {kind}.",
            where,
            has=kind,
            columns=columns,
            kind=wanted,
        )
