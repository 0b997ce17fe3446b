"""What steps and axes are called in a cell: by what carries its scanners, and what its object rides on."""

from typing import Final

from calib_core.cell.axes import TABLE
from calib_core.cell.carriers import carrier_of_all, scanner_mount, scanner_names
from calib_core.messages import message, templates
from calib_core.records import Cell

SCANNER_IN_BASE: Final = message("Scanner in base")
_AXIS: Final = templates({"rotary": "Rotary axis {axis}", "linear": "Linear axis {axis}"})
_SCANNERS: Final = templates({
    ("tool0", False): "Scanner on the flange",
    ("base", False): "Scanner in base",
    ("tool0", True): "Scanner {scanner} on the flange",
    ("base", True): "Scanner {scanner} in base",
})  # fmt: skip


def scanner_title(into: str, outof: str, scanner: str | None) -> str:
    """Return what a scanner's frame is called, on what carries it, or before another one that its frame names."""
    if into.startswith("laser:"):
        one, other = (name.partition(":")[2] for name in (outof, into))
        return message("Scanner {scanner} seen from {other}", scanner=one, other=other)
    if (into, bool(scanner)) in _SCANNERS:
        return message(_SCANNERS[into, bool(scanner)], scanner=scanner or "")
    return message("Scanner {scanner} on {carrier}", scanner=scanner or "", carrier=into)


def axis_title(name: str, kind: str) -> str:
    """Return what an axis is called; a rotary one that the cell does not name is the turntable."""
    return message("Turntable") if (name, kind) == (TABLE, "rotary") else message(_AXIS[kind], axis=name)


def object_axes_title(cell: Cell) -> str:
    """Return what the axes are called that carry the object; the turntable where the cell names none."""
    axes = [axis for axis in cell.axes or () if axis.carries == "object"]
    if len(axes) > 1:
        return message("Axes {axes}", axes=", ".join(axis.name for axis in axes))
    return axis_title(axes[0].name, axes[0].kind) if axes else message("Turntable")


def object_only_slides(cell: Cell) -> bool:
    """Return whether every axis that carries the object is a linear one."""
    return {axis.kind for axis in cell.axes or () if axis.carries == "object"} == {"linear"}


def step_title(cell: Cell, step: str) -> str | None:
    """Return what a step is called in a cell where its usual name does not fit."""
    mounts = [scanner_mount(cell, name) for name in scanner_names(cell) or (None,)]
    if step == "tcp" and carrier_of_all(mounts) == "base":
        return SCANNER_IN_BASE
    axes = object_axes_title(cell)
    return axes if step == "turntable" and axes != message("Turntable") else None
