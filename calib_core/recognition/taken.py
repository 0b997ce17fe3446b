"""What a file is taken for, and why: names, reasons and the poses of one file."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from calib_core import counted
from calib_core.frames import FloatArray
from calib_core.messages import Message, message, templates

if TYPE_CHECKING:
    from calib_core.recognition.tracker_points import Centers

TakenFor = Literal[
    "profiles", "clouds", "frames", "boards", "centers", "poses", "backup", "certificate", "session", "nothing"
]
"""What a file can be taken for; `backup` is a controller's file with tools and frames, but no poses.

`centers` are a laser tracker's points: each is a measurement of its own.
"""

TAKEN_FOR_WORDS: dict[TakenFor, str] = templates(
    {
        "profiles": "profiles",
        "clouds": "clouds",
        "frames": "frames",
        "boards": "boards",
        "centers": "tracker's points",
        "poses": "poses",
        "backup": "controller's files",
        "certificate": "certificate",
        "session": "session",
        "nothing": "nothing",
    }
)
MEASUREMENTS: tuple[TakenFor, ...] = ("profiles", "clouds", "frames", "boards")

HEAD_BYTES = 65_536
"""So much of a file tells what it is; only pose lists and controllers' files are read whole."""

_DRAWN = 60

_REASONS = templates(
    {
        "empty": "The file is empty.",
        "link": "A link, or nothing that can be read: it is not followed.",
        "unreadable": "It cannot be read: check its permissions.",
        "system": "A file of the operating system.",
        "binary": "Binary data that no reader knows.",
        "text": "Text in which neither points nor poses were found.",
        "points": "{title}: {how}.",
        "table": "{rows} rows of {columns} numbers: points.",
        "table-begun": "At least {rows} rows of {columns} numbers: points.",
        "picture": "An image.",
        "board": "An image of a board.",
        "centers": "{points} points of a laser tracker in {unit}.",
        "centers-sure": "{points} points of a laser tracker in {unit}, each axis ± {sigma_mm:.3g} mm (1 sigma).",
        "centers-unit": "{points} points of a laser tracker, and nothing says their unit.",
        "centers-beside": "{points} points of a laser tracker: give them a folder of their own, "
        "without other scans.",
        "mesh": "A mesh, not a measurement.",
        "poses": "{poses} of {numbers} numbers.",
        "poses-under": "{poses} of {numbers} numbers under {key}.",
        "controller-poses": "{brand}: {poses}, {tools}, {frames}.",
        "controller": "{brand}: {tools}, {frames}, no poses.",
        "controller-skipped": "{brand}: {tools}, {frames}, no poses. {because}",
        "controller-unread": "{brand}: {because}",
        "joints-alone": "Joints without poses: `scancell new --arm NAME` makes poses of them.",
        "joints-of": "Joints of {poses}, taken with {other}.",
        "joints-by-arm": "Joints of {poses}, which follow from them by the nominal lengths of {arm}.",
        "same-poses": "The same poses as in {other}.",
        "other-poses": "{poses} for {measurements} measurements, which {other} fits better.",
        "rival-poses": "Other poses than in {other}, which is taken.",
        "copy": "The same content as {other}: a copy.",
        "one-pose": "One pose, named after no measurement.",
        "settings": "Settings or results of another program ({keys}), neither profiles nor a list of poses.",
        "settings-sphere": "Settings or results of another program ({keys}); "
        "they tell a sphere of {sphere_mm:g} mm.",
        "certificate": "A digital calibration certificate (DCC).",
        "session": "A session's own record.",
        "archive": "An archive of a session: open it instead of making a new session of it.",
        "result": "A result or an answer of a session, no measurement.",
        "zip": "A zip file with nothing of a known controller in it: unpack it.",
        "office": "A document of an office program: export its table as CSV.",
        "compiled": "{what}: {to_do}",
        "damaged": "{because}",
        "told": "Taken so because it was told.",
        "missing-measurements": "No file holds profiles, clouds or frames.",
        "missing-poses": "No file holds where the robot stood: give its poses.",
        "missing-poses-of": "No pose for {names}.",
        "missing-angles": "{name} leaves the table's angle open in line {lines}: write it there, or list captures "
        "of the sphere that stands still in a file of their own.",
        "rows-not-whole": "{name} has no whole pose in line {lines}.",
        "missing-convention": "The convention of the poses is not certain: {choices}.",
        "open-angles": "Nothing says whether the angles are degrees or radians: all lie within ± 3.2. Write their "
        "unit behind their names, as in A [deg] or A [rad].",
        "missing-sphere": "The sphere's diameter is missing.",
        "paired-by-order": "{measurements} measurements, {poses}, in their order: which ones lack is not known.",
        "rival-lists": "{names} hold different poses: the first is taken.",
        "beyond": "Beyond the {most} files that are read at once.",
    }
)


_COUNTED: Mapping[str, Callable[[int], Message]] = {
    "poses": counted.poses,
    "tools": counted.tools,
    "frames": counted.frames,
}


@dataclass(frozen=True)
class Reason:
    """Why a file is taken for what it is: a code of `_REASONS` and its values."""

    code: str
    values: Mapping[str, str | int | float] = field(default_factory=dict[str, str | int | float])

    @property
    def text(self) -> Message:
        """What it says."""
        said = {name: many(int(self.values[name])) for name, many in _COUNTED.items() if name in self.values}
        return message(_REASONS[self.code], **{**self.values, **said})

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON data."""
        return {"reason": self.code, "values": dict(self.values), "why": self.text}


@dataclass(frozen=True)
class GivenFile:
    """A file that came: its name below the folder, its bytes, whole or their beginning, and its size.

    `refused` is the code of a reason why it was not even read, `digest` a hash of all of it where the bytes are
    its beginning alone.
    """

    name: str
    data: bytes
    size: int | None = None
    refused: str = ""
    digest: bytes = b""

    @property
    def head(self) -> bytes:
        """The bytes that tell what it is."""
        return self.data[:HEAD_BYTES]

    @property
    def whole(self) -> bool:
        """Whether all of it is there."""
        return self.size is None or len(self.data) >= self.size

    @property
    def folder(self) -> str:
        """The folder it lies in, nothing for the one that was given."""
        return self.name.rpartition("/")[0]

    @property
    def stem(self) -> str:
        """Its name without folder and ending."""
        return stem_of(self.name)


def stem_of(name: str) -> str:
    """Return a file's name without folder and ending."""
    last = name.rpartition("/")[2]
    return last.rpartition(".")[0] or last


@dataclass(frozen=True)
class PoseRow:
    """One pose as a file has it; `number` is what its first column counts, `time_s` when the robot was there.

    A number that is left blank is NaN.  `has_table` is whether its list has a column of a table's angles.
    """

    numbers: tuple[float, ...]
    line: int
    name: str = ""
    number: int | None = None
    time_s: float | None = None
    file: str = ""
    joints_deg: tuple[float, ...] | None = None
    table_deg: float | None = None
    has_table: bool = False
    doubt: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON data."""
        return {
            "name": self.name,
            "pose": list(self.numbers),
            "file": self.file,
            "line": self.line,
            "time_s": self.time_s,
            "joints_deg": None if self.joints_deg is None else list(self.joints_deg),
            "table_deg": self.table_deg,
            "doubt": self.doubt or None,
        }


@dataclass(frozen=True)
class PoseList:
    """The poses of a file, and the conventions in which they can be written: one where the file says which.

    `open_angles` is whether it says nothing of the unit of their angles.
    """

    rows: tuple[PoseRow, ...]
    conventions: tuple[str, ...]
    open_angles: bool = False


@dataclass(frozen=True)
class Look:
    """What one file is taken for, and what was found in it; `preview` are some of its points, x and z in mm.

    `notes` are what its reader says of an arm that was told; `joints` rows of joints alone, without a pose.
    """

    taken_for: TakenFor
    reason: Reason
    brand: str = ""
    poses: PoseList | None = None
    sphere_mm: float | None = None
    file: GivenFile = GivenFile("", b"")
    preview: tuple[tuple[float, float], ...] = ()
    centers: "Centers | None" = None
    notes: tuple[str, ...] = ()
    joints: tuple[PoseRow, ...] = ()


def nothing(code: str, **values: str | float) -> Look:
    """Return a look at a file that is not used."""
    return Look("nothing", Reason(code, values))


def preview_of(points: FloatArray) -> tuple[tuple[float, float], ...]:
    """Return some of the points (N, 2) or (N, 3) for a small picture, x and z."""
    known = points[np.isfinite(points).all(axis=1)]
    some = known[:: max(1, -(-len(known) // _DRAWN))]
    return tuple((round(float(row[0]), 3), round(float(row[-1]), 3)) for row in some)
