"""The cell as a picture for the report's first page: sphere, scanner, table, from above and from the side."""

from collections.abc import Mapping
from html import escape
from typing import Any, Final

import numpy as np

from calib_core.captures.poses import middle_pose
from calib_core.cell.found import scanner_frame
from calib_core.errors import CalibrationError
from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import ENGLISH, Catalogue, message
from calib_core.records import ResultsData, Session
from calib_core.steps import steps_that_show, tool_stages

_SIZE: Final = 300.0
_EDGE: Final = 26.0
_MOST: Final = 200
_COLORS: Final = {True: "#0b57b0", False: "#b3261e", None: "#8a94a0"}
"""Of captures that some stage used, that were left out, and that nothing judged."""
_ABOVE, _BESIDE = message("from above"), message("from the side")
_RIM: Final = np.linspace(0.0, 2 * np.pi, 49)


def scene_picture(session: Session, results: ResultsData, said: Catalogue = ENGLISH) -> str:
    """Return an SVG of the answer's cell in base, empty where there is no answer or no pose can be read."""
    result = next((results[name] for name in tool_stages() if name in results), None)
    if result is None or not result.get("sphere_center_in_base_mm"):
        return ""
    tool = scanner_frame(result)
    used: dict[str, bool] = {}
    for one in results.values():  # a capture counts where any stage used it: others judge those that verify
        for row in one.get("residuals", []):
            used[row["capture"]] = used.get(row["capture"], False) or bool(row.get("used"))
    steps = steps_that_show("sphere")
    scanners: list[FloatArray] = []
    kept: list[str] = []
    for capture in session.captures:
        if capture.step not in steps or len(scanners) == _MOST:
            continue
        try:
            scanners.append((middle_pose(session.cell, capture) @ tool).translation_mm)
        except CalibrationError:
            continue  # changed since it was solved
        kept.append(_COLORS[used.get(capture.id, False if capture.excluded else None)])
    if not scanners:
        return ""
    center = np.array(result["sphere_center_in_base_mm"], dtype=float)
    rim = _rim(result)
    shown = np.concatenate([np.array(scanners), center[None], *([] if rim is None else [rim])])
    views = ((said.say(_ABOVE), 0, 1), (said.say(_BESIDE), 0, 2))
    radius = (session.cell.sphere_diameter_mm or 0.0) / 2
    drawn: list[str] = []
    for title, *axes in views:
        flat = None if rim is None else rim[:, axes]
        drawn.append(_view(title, np.array(scanners)[:, axes], kept, center[axes], radius, flat, shown[:, axes]))
    inside = "".join(f'<g transform="translate({k * (_SIZE + 20):g} 0)">{one}</g>' for k, one in enumerate(drawn))
    words = escape(
        said.say(message("The cell in base: the sphere and the scanner at {count} captures", count=len(scanners)))
    )
    width = 2 * _SIZE + 20
    return (
        f'<svg class="scene" viewBox="0 0 {width:g} {_SIZE:g}" width="{width:g}" height="{_SIZE:g}" role="img" '
        f'aria-label="{words}">{inside}</svg>'
    )


def _rim(result: Mapping[str, Any]) -> FloatArray | None:
    """Return a circle (N, 3) where the sphere went round on the table, None without a table."""
    table, mounts = result.get("base_from_turntable"), result.get("mounts")
    if table is None or not mounts:
        return None
    places = np.array([mount["center_in_turntable_mm"] for mount in mounts], dtype=float)
    radius, height = float(np.hypot(places[:, 0], places[:, 1]).max()), float(places[:, 2].min())
    circle = np.column_stack([radius * np.cos(_RIM), radius * np.sin(_RIM), np.full(len(_RIM), height)])
    return RigidTransform.from_rounded(table, "base", "turntable").apply(circle)


def _view(
    title: str,
    scanners: FloatArray,
    colors: list[str],
    center: FloatArray,
    radius_mm: float,
    rim: FloatArray | None,
    shown: FloatArray,
) -> str:
    low, high = shown.min(axis=0) - radius_mm, shown.max(axis=0) + radius_mm
    scale = (_SIZE - 2 * _EDGE) / max(float((high - low).max()), 1.0)
    middle = (low + high) / 2

    def at(place: FloatArray) -> tuple[float, float]:
        x, y = (place - middle) * scale
        return _SIZE / 2 + float(x), _SIZE / 2 - float(y)

    cx, cy = at(center)
    parts = [f'<text x="8" y="20">{title}</text>']
    if rim is not None:
        path = "L".join("{:.1f} {:.1f}".format(*at(place)) for place in rim)
        parts.append(f'<path d="M{path}Z" fill="none" stroke="#8a94a0"/>')
    for place, color in zip(scanners, colors, strict=True):
        x, y = at(place)
        parts.append(f'<path d="M{x:.1f} {y:.1f}L{cx:.1f} {cy:.1f}" stroke="{color}" stroke-opacity="0.25"/>')
        parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{color}"/>')
    parts.append(f'<circle cx="{cx:.1f}" cy="{cy:.1f}" r="{max(radius_mm * scale, 3.0):.1f}" fill="#c9a227"/>')
    length = _round_length((_SIZE - 2 * _EDGE) / scale / 4)
    end = 8 + length * scale
    parts.append(f'<path d="M8 {_SIZE - 10:g}H{end:.1f}" stroke="#5b6570" stroke-width="2"/>')
    parts.append(f'<text x="{end + 6:.1f}" y="{_SIZE - 6:g}">{length:g} mm</text>')
    return "".join(parts)


def _round_length(length_mm: float) -> float:
    """Return the largest of 1, 2, 5 × a power of ten that is no longer."""
    power = 10.0 ** np.floor(np.log10(max(length_mm, 1e-3)))
    return float(next(step * power for step in (5.0, 2.0, 1.0) if step * power <= length_mm or step == 1.0))
