"""Where a cell's axes are to stand for a capture, in a line."""

from typing import Protocol


class _Asked(Protocol):
    """A capture that is asked for."""

    axes_deg: dict[str, float] | None
    axes_mm: dict[str, float] | None
    scanner: str | None


def where_axes(asked: _Asked) -> str:
    """Return where named axes are to stand, and whose capture it is; empty where the cell names none."""
    turns = "".join(f"  {name} {value:.1f}°" for name, value in (asked.axes_deg or {}).items())
    shifts = "".join(f"  {name} {value:.1f} mm" for name, value in (asked.axes_mm or {}).items())
    return turns + shifts + (f"  ({asked.scanner})" if asked.scanner else "")
