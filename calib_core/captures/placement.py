"""Where scans belong: the calibration that brings every scanner's points into one frame, whatever carries what."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from calib_core.cell.axes import axis_of_mounts, moved_axes, part_on_flange, read_axes
from calib_core.cell.carriers import other_end, rides_with_robot, scanner_mount, scanner_name, scanner_names
from calib_core.cell.found import as_used, known_scanner, on_flange, placed_scanner
from calib_core.cell.layout import MovedAxis
from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform, rotation_from_vector, with_third
from calib_core.records import Capture, Cell


@dataclass(frozen=True, eq=False)
class PlacedAxis:
    """An axis as it stands in base where all read zero, and the covariance (6, 6) of its frame, z along it."""

    edge: MovedAxis
    base_from_axis: RigidTransform
    turns: float
    covariance: FloatArray

    def motion(self, reading: float) -> RigidTransform:
        """Return how it moves in base what it carries, at a reading in rad or mm."""
        along = np.array([0.0, 0.0, self.turns * reading])
        rotary = self.edge.kind == "rotary"
        rotation = rotation_from_vector(along) if rotary else np.eye(3)
        moved = RigidTransform.of(rotation, np.zeros(3) if rotary else along, "turntable", "turntable")
        return self.base_from_axis @ moved @ self.base_from_axis.inverse()


@dataclass(frozen=True, eq=False)
class Placement:
    """The calibration that brings scans into one frame.

    Parameters
    ----------
    mount_from_laser : RigidTransform
        Of the scanner, or of the first one.
    base_from_turntable : RigidTransform or None
        None: no table, scans are merged in base.
    direction : int
        The table's sense of turning.
    scale : float
        How far the table turns for each unit that its encoder reads.
    mounts : mapping
        Of several scanners, by their names.
    axes : tuple of PlacedAxis
        Where the cell names its axes.
    carrier : str
        What carries the object: one of them, base, or the flange before scanners that stand still.
    cell : Cell, optional
        Where it has several scanners or axes.
    sheet_per_mm : float
        How far profiles' light lies off its plane along y, over the square of x.
    sheets_per_mm : mapping
        The same of several scanners, by their names.
    origin_mm : tuple of 3
        Without a table, where in base the scans' frame has its zero: near the part, for single precision.
    """

    mount_from_laser: RigidTransform
    base_from_turntable: RigidTransform | None
    direction: int = 1
    scale: float = 1.0
    mounts: Mapping[str, RigidTransform] = field(default_factory=dict[str, RigidTransform])
    axes: tuple[PlacedAxis, ...] = ()
    carrier: str = "base"
    cell: Cell | None = None
    sheet_per_mm: float = 0.0
    sheets_per_mm: Mapping[str, float] = field(default_factory=dict[str, float])
    origin_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def first(self) -> RigidTransform:
        """The one of `mounts` that is `mount_from_laser`, itself where there are none."""
        rows = self.mount_from_laser.to_rows()
        return next((one for one in self.mounts.values() if one.to_rows() == rows), self.mount_from_laser)

    def places(self, capture: Capture) -> bool:
        """Return whether it says where the scanner of a capture is."""
        return not self.mounts or self.cell is None or scanner_name(self.cell, capture) in self.mounts

    def mount(self, capture: Capture) -> RigidTransform:
        """Return where the scanner of a capture is on what carries it."""
        if not self.mounts or self.cell is None:
            return self.mount_from_laser
        name = scanner_name(self.cell, capture)
        if not self.places(capture):
            need = "where the scanner '{scanner}' is, since a scan is of it"
            to_do = "Capture the sphere with this scanner, too, or exclude its scans."
            raise InputError(need, "only {known}", to_do, capture.id, scanner=name, known=", ".join(self.mounts))
        return self.mounts[name]

    def sheet(self, capture: Capture) -> float:
        """Return how the sheet of light of a capture's scanner is bent, as `sheet_per_mm` is."""
        if not self.sheets_per_mm or self.cell is None:
            return self.sheet_per_mm
        return self.sheets_per_mm.get(scanner_name(self.cell, capture), 0.0)

    @property
    def told(self) -> tuple[object, ...]:
        """All that it says, to be compared."""
        frames = [self.mount_from_laser, self.base_from_turntable, *self.mounts.values()]
        axes = [(axis.base_from_axis.to_rows(), axis.turns) for axis in self.axes]
        rows = [None if frame is None else frame.to_rows() for frame in frames]
        return (
            rows,
            axes,
            self.direction,
            self.scale,
            self.carrier,
            self.sheet_per_mm,
            [*self.sheets_per_mm.items()],
        )

    @property
    def held(self) -> bool:
        """Whether the flange carries the object: what robots' poses move is then the object."""
        return rides_with_robot(self.carrier)

    def way(self, capture: Capture, base_from_carrier: RigidTransform) -> RigidTransform:
        """Return the way from a capture's scanner into the frame of all, by where what carries it is.

        Of an object that the flange carries, by where the flange is.

        Raises
        ------
        InputError
            Where the table turns and its angle is not told.
        """
        into = self.turntable_from_base(capture, base_from_carrier)
        return into @ self.carried(capture, base_from_carrier) @ self.mount(capture)

    def carried(self, capture: Capture, base_from_carrier: RigidTransform) -> RigidTransform:
        """Return where what carries a capture's scanner is, the axes that carry the robot moved."""
        if self.held:
            return RigidTransform.identity("base", "base")
        return self.foot(capture) @ base_from_carrier if on_flange(self.mount(capture)) else base_from_carrier

    def foot(self, capture: Capture, ball: str = "base", off: Mapping[str, float] | None = None) -> RigidTransform:
        """Return how axes moved the robot, as seen from what carries a ball: base, or an axis of the object.

        `off` is added to the axes' readings, rad and mm.
        """
        feet = [axis.edge.name for axis in self.axes if axis.edge.carries == "robot"]
        foot = self._moved(feet[-1] if feet else "base", capture, off)
        return self._moved(ball, capture, off).inverse() @ foot

    @property
    def in_base(self) -> "Placement":
        """The same for an object that stands in base."""
        return replace(self, base_from_turntable=None, carrier="base")

    def turntable_from_base(
        self, capture: Capture, base_from_tool0: RigidTransform | None = None
    ) -> RigidTransform:
        """Return the way from base into T as axes, or the flange that holds the object, stand; raises InputError.

        The identity without any.
        """
        if self.held and base_from_tool0 is not None:
            return (self.foot(capture) @ base_from_tool0).inverse()
        stands = self.base_from_turntable or RigidTransform.of(
            [0.0, 0.0, 0.0], self.origin_mm, "base", "turntable"
        )
        if self.axes:
            return (self._moved(self.carrier, capture) @ stands).inverse()
        if self.base_from_turntable is None:
            return stands.inverse()
        if capture.table_deg is None:
            to_do = "Read it from the table and add it; 0 where the table was not turned."
            raise InputError("the table's angle in the scan's field 'table_deg'", "none", to_do, capture.id)
        angle = self.direction * self.scale * float(np.deg2rad(capture.table_deg))
        back = RigidTransform.of([0.0, 0.0, -angle], [0.0, 0.0, 0.0], "turntable", "turntable")
        return back @ self.base_from_turntable.inverse()

    def _moved(self, carrier: str, capture: Capture, off: Mapping[str, float] | None = None) -> RigidTransform:
        """Return how an axis, and those that it stands on, moved in base what they carry."""
        every = {axis.edge.name: axis for axis in self.axes}
        read = read_axes(self.cell, capture) if self.cell else {}
        moved = RigidTransform.identity("base", "base")
        while carrier in every:
            moved = every[carrier].motion(read.get(carrier, 0.0) + (off or {}).get(carrier, 0.0)) @ moved
            carrier = every[carrier].edge.on
        return moved

    def with_axis_moved(self, which: int, step: FloatArray) -> "Placement":
        """Return the same with one axis's frame changed by a step (6,)."""
        axes = [*self.axes]
        axes[which] = replace(axes[which], base_from_axis=axes[which].base_from_axis.perturbed(step))
        return replace(self, axes=tuple(axes))


def placement_of(cell: Cell, captures: Sequence[Capture], solved: Sequence[Mapping[str, Any]]) -> Placement | None:
    """Return the calibration by results as JSON data, the one that counts first, and by what the user brings.

    None without a scanner's pose.
    """
    used = [as_used(result) for result in solved]
    tool = next(filter(None, map(placed_scanner, solved)), known_scanner(cell))
    if tool is None:
        return None
    table = next((result for result in used if result.get("base_from_turntable") is not None), {})
    matrix = table.get("base_from_turntable", cell.known.base_from_turntable)
    encoder = table.get("encoder_scale") or {}
    mounts = {one.scanner: one.matrix for one in cell.known.frames or [] if one.outof == "laser" and one.scanner}
    for result in reversed(used):
        for one in result.get("frames", []):
            known = np.isfinite(np.array(one["matrix"], dtype=float)).all()
            if one["outof"] == "laser" and one.get("scanner") and known:
                mounts[one["scanner"]] = one["matrix"]
    if len(scanner_names(cell)) > 1:
        solved_for = next((one["scanner"] for one in used if isinstance(one.get("scanner"), str)), None)
        mounts.setdefault(solved_for or scanner_names(cell)[0], tool.to_rows())
    found = {axis["name"]: axis for result in reversed(used) for axis in result.get("axes", [])}
    edges = [edge for edge in moved_axes(cell) if edge.name in found]
    return Placement(
        tool,
        None if matrix is None else RigidTransform.from_rounded(matrix, "base", "turntable"),
        table.get("direction", cell.turntable.direction or 1),
        1.0 + (encoder["error"] if encoder.get("applied") else 0.0),
        {
            name: RigidTransform.from_rounded(rows, scanner_mount(cell, name), "laser")
            for name, rows in mounts.items()
        },
        tuple(_placed(edge, found[edge.name]) for edge in edges),
        _carrier(cell, captures),
        cell,
        next(filter(None, map(sheet_per_mm_of, used)), 0.0),
        next(filter(None, map(sheets_per_mm_of, used)), {}),
    )


def sheet_per_mm_of(result: Mapping[str, Any]) -> float:
    """Return by how much a result tells that the scanner's sheet of light is bent, as `Placement` has it."""
    return _sheet_per_mm(result.get("scanner"))


def sheets_per_mm_of(result: Mapping[str, Any]) -> dict[str, float]:
    """Return the same of several scanners by their names, those that are bent."""
    each = {name: _sheet_per_mm(one) for name, one in (result.get("scanner_errors") or {}).items()}
    return {name: bent for name, bent in each.items() if bent}


def _sheet_per_mm(told: Any) -> float:
    found: Mapping[str, Any] = told if isinstance(told, dict) else {}
    return found["sheet_bend_mm"] / found["half_width_mm"] ** 2 if found.get("sheet_bend_mm") else 0.0


def _carrier(cell: Cell, captures: Sequence[Capture]) -> str:
    """Return which axis carries the object, or the flange, base where none does."""
    if part_on_flange(cell, captures):
        return other_end("base")
    of_one_object = [capture.model_copy(update={"mount": None}) for capture in captures]
    return next(iter(axis_of_mounts(cell, of_one_object).values()), "base")


def _placed(edge: MovedAxis, found: Mapping[str, Any]) -> PlacedAxis:
    if found["axis_point_mm"] and not np.isfinite(np.array(found["axis_point_mm"], dtype=float)).all():
        need = "the place of the axis '{axis}'"
        to_do = "Turn the flange between captures of the sphere, then solve again."
        raise InputError(need, "one that the captures leave open", to_do, axis=edge.name)
    direction = np.array(found["axis_direction"], dtype=float)
    point = np.array(found["axis_point_mm"] or [0.0, 0.0, 0.0], dtype=float)
    frame = RigidTransform.of(with_third(direction / np.linalg.norm(direction)), point, "base", "turntable")
    return PlacedAxis(edge, frame, found["direction"] * found["scale"], np.array(found["covariance"], dtype=float))
