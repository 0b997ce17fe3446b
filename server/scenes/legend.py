"""The legend: what the colours mean, with units, as HTML for the live scene and for the offline file."""

from collections.abc import Collection, Sequence
from html import escape
from itertools import pairwise

import numpy as np

from calib_core.evidence.numbers import decimals_of_uncertainty, number_text
from calib_core.messages import message, plural
from server.scenes.answers import magnified as answers_magnified
from server.scenes.cloud_layers import height_range_mm, intensity_range, shown_cloud
from server.scenes.cloud_view import Section
from server.scenes.colors import (
    BOARD,
    DIVERGING,
    FIRST,
    GHOST,
    GREYS,
    LIGHT,
    REJECTED,
    SCANS,
    SECOND,
    SPHERE,
    UNCERTAIN,
    USED,
    VIRIDIS,
    WAITING,
    Rgb,
    band_limits_mm,
    band_numbers,
    css,
    length_text,
)
from server.scenes.deviation import CloudDeviation
from server.scenes.display_options import Look
from server.scenes.interim_layers import AXIS_TIMES
from server.scenes.merged import MergedScans
from server.scenes.optics import BASE_FROM_CAMERA, OpticsFacts
from server.scenes.scene_model import BY_HAND, KnownHowWell, SceneFacts
from server.scenes.turntable import TableFacts
from server.scenes.turntable_layers import AXIS, mount_color
from server.scenes.uncertainty import is_cut, magnified


def legend_html(facts: SceneFacts, look: Look, layers: Collection[str] | None = None) -> str:
    """Return the legend of a scene, or of those of its layers; without a result it says what is still to come."""

    def told(*names: str) -> bool:
        return layers is None or any(name in layers for name in names)

    parts = _of_captures(facts, look) if told("frames", "points") else []
    if facts.captures and facts.knows_scanner and told("light"):
        parts.append(_key(LIGHT, "◣", message("plane of light")))
    if facts.table is not None and told("table"):
        parts += _of_table(facts.table, places=told("circles", "places"), circles=told("circles"))
    if facts.optics is not None and told("camera"):
        parts += _of_optics(facts.optics)
    if (cloud := shown_cloud(facts, look)) is not None and told("scans"):
        parts += _of_cloud(cloud, look)
    if _told_how_well(facts.uncertainty) and told("uncertainty"):
        said = message("uncertainty, k\u00a0=\u00a02, ×{times}", times=magnified(facts))
        if is_cut(facts):
            said = message("uncertainty, k\u00a0=\u00a02, larger than drawn")
        parts.append(_key(UNCERTAIN, "●", said))
    if facts.so_far is not None and told("so-far"):
        parts.append(_key(SPHERE, "●", message("scanner and sphere, as far as known")))
        parts.append(_key(GHOST, "●", message("uncertainty by now, k\u00a0=\u00a02, at most 25 mm drawn")))
    if facts.table_so_far is not None and told("table-so-far"):
        parts.append(
            _key(GHOST, "◍", message("axis by now, k\u00a0=\u00a02, ×{axis_times}", axis_times=AXIS_TIMES))
        )
    if facts.field is not None and layers is not None and "field" in layers:
        low, high = facts.field.range_mm
        parts.append(f"<div>{_head(message('One scan of the object, k = 2'))}{_bar(VIRIDIS)}")
        ends = (number_text(one, decimals_of_uncertainty(low)) for one in (low, high))
        parts.append(f'<div class="ticks">{"".join(f"<span>±{end} mm</span>" for end in ends)}</div></div>')
    if facts.compared and layers is not None and "answers" in layers:
        parts += [_key(FIRST, "●", message("first answer")), _key(SECOND, "●", message("second answer"))]
        times = answers_magnified(facts)
        parts.append(_line(message("Ellipsoids, k\u00a0=\u00a02, and the way between them ×{times}", times=times)))
    if look.alone:
        parts.append(_line(message("The cell as it stood at capture {capture}.", capture=look.picked or "")))
    return "".join(parts)


def _told_how_well(known: KnownHowWell | None) -> bool:
    return known is not None and any(part is not None for part in (known.tool, known.sphere, known.table))


def _of_captures(facts: SceneFacts, look: Look) -> list[str]:
    count = {state: sum(c.state == state for c in facts.captures) for state in ("used", "rejected", "waiting")}
    parts: list[str] = []
    if any(facts.residuals_mm(capture) is not None for capture in facts.captures):
        parts.append(_scale(look.limit_mm))
        parts.append(_key(USED, "●", message("{count} used", count=count["used"])))
        if count["waiting"]:
            parts.append(_key(WAITING, "●", message("{count} not in the result", count=count["waiting"])))
    elif facts.captures and not facts.knows_scanner and facts.so_far is not None:
        parts.append(_key(WAITING, "●", _captures(count["waiting"])))
    elif facts.captures and not facts.knows_scanner:
        parts.append(
            _line(message("Only the flange is known so far. Scanner and sphere appear with the first result."))
        )
        parts.append(_key(WAITING, "●", _captures(count["waiting"])))
    elif facts.captures:
        parts.append(_key(USED, "●", message("{count} used", count=count["used"])))
    elif facts.optics is None and facts.table is None:
        line = message(
            "Nothing to draw yet. Captures with a pose appear here as they come in, boards with the solved camera."
        )
        parts.append(_line(line))
    excluded = sum(c.state == "rejected" and c.reason == BY_HAND for c in facts.captures)
    if count["rejected"] > excluded:
        parts.append(_key(REJECTED, "✕", message("{count} rejected", count=count["rejected"] - excluded)))
    if excluded:
        parts.append(_key(REJECTED, "✕", message("{excluded} excluded", excluded=excluded)))
    return parts


def _of_table(table: TableFacts, *, places: bool, circles: bool) -> list[str]:
    parts = [_head(table.title), _key(AXIS, "↑", message("axis, T at {zero}", zero=table.zero))]
    mounts = (table.mounts or {}) if places else {}
    parts += [
        _key(
            mount_color(table, mount), "●", message("sphere {mount}", mount=mount) if mount else message("Sphere")
        )
        for mount in mounts
    ]
    if table.circles and circles:
        parts.append(_key(WAITING, "○", message("circles of the paper's method")))
    return parts


def _of_optics(optics: OpticsFacts) -> list[str]:
    parts = [_head(message("Camera"))]
    plain = sum(board.used and not board.with_stripe for board in optics.boards)
    striped = sum(board.used and board.with_stripe for board in optics.boards)
    rejected = len(optics.boards) - plain - striped
    for color, sign, number, what in (
        (BOARD, "▰", plain, plural("{count} board", "{count} boards", by="count", count=plain)),
        (
            LIGHT,
            "▰",
            striped,
            plural("{count} board with the stripe", "{count} boards with the stripe", by="count", count=striped),
        ),
        (
            REJECTED,
            "✕",
            rejected,
            plural("{count} board rejected", "{count} boards rejected", by="count", count=rejected),
        ),
    ):
        if number:
            parts.append(_key(color, sign, what))
    if optics.camera_from_laser is not None:
        parts.append(_key(LIGHT, "◣", message("plane of light")))
    if optics.base_from_camera is BASE_FROM_CAMERA:
        parts.append(_line(message("Drawn beside the base: where the camera stood in the cell is not known.")))
    return [*parts, *map(_line, optics.missing)]


def _of_cloud(merged: MergedScans, look: Look) -> list[str]:
    parts = [_head(message("Merged cloud") if merged.fused else message("Scans"))]
    frame = "T" if merged.frame == "turntable" else merged.frame
    if look.cloud.colors == "by deviation":
        parts += _of_deviation(look.deviation)
    elif look.cloud.colors == "by intensity" and merged.every_intensity is not None:
        low, high = intensity_range(merged)
        parts += [_bar(GREYS), f'<div class="ticks"><span>{low:.4g}</span><span>{high:.4g}</span></div>']
        parts.append(_line(message("Intensity, as the scanner tells it")))
    elif (look.cloud.colors != "by scan" and not merged.waiting) or not merged.names:
        low, high = height_range_mm(merged)
        parts.append(_bar(VIRIDIS))
        top = message("{high_mm:.1f} mm in {frame}", high_mm=high, frame=frame)
        parts.append(f'<div class="ticks"><span>z {number_text(low, 1)} mm</span><span>{top}</span></div>')
    else:
        parts += [
            _key(SCANS[number % len(SCANS)], "●", name) for number, name in enumerate(merged.names[: len(SCANS)])
        ]
        if len(merged.names) > len(SCANS):
            parts.append(
                _line(message("and {count} more, the same colours again", count=len(merged.names) - len(SCANS)))
            )
        if merged.fused:
            parts.append(_line(message("Each patch in the colour of the scan that weighs most in it")))
    if look.cloud.section is not None:
        parts.append(_line(_cut_words(look.cloud.section, frame)))
    shown = len(merged.points_mm)
    part = (
        message("{rows} of {count}", rows=number_text(shown, 0), count=number_text(merged.measured, 0))
        if shown < merged.measured
        else number_text(shown, 0)
    )
    if merged.fused:
        return [*parts, _line(message("{part} points, cleaned and merged.", part=part))]
    as_measured = message("{part} points as they were measured: not cleaned, not registered.", part=part)
    return [*parts, _line(as_measured)]


def _of_deviation(deviation: CloudDeviation | str | None) -> list[str]:
    if not isinstance(deviation, CloudDeviation):
        return [_line(deviation or message("No deviations yet."))]
    what = _line(message("Distance to {what}", what=deviation.words))
    limit = length_text(deviation.limit_mm)
    ends = f"<span>≤ −{limit}</span><span>0</span><span>≥ +{limit}</span>"
    scale = [f'<div>{what}{_bar(DIVERGING)}<div class="ticks">{ends}</div>{_sides()}</div>']
    return [
        *(scale if deviation.tolerance_mm is None else [what, *_bands(deviation, deviation.tolerance_mm)]),
        _line(
            message(
                "RMS {rms_mm:.3f} mm over {points} points",
                rms_mm=deviation.found.rms_mm,
                points=number_text(deviation.found.counted, 0),
            )
        ),
    ]


def _bands(deviation: CloudDeviation, tolerance_mm: float) -> list[str]:
    """Return the bands of a tolerance, the farthest outside first: colour, limits, and how many points it has."""
    values = deviation.values_mm[np.isfinite(deviation.values_mm)]
    counts = np.bincount(band_numbers(values, tolerance_mm), minlength=len(DIVERGING))
    ends = [f"{'−' if end < 0 else '+'}{length_text(abs(end))}" for end in band_limits_mm(tolerance_mm).tolist()]
    below, *between, above = (100 * counts / max(len(values), 1)).tolist()
    said = [
        message("below {end}: {share:.1f} %", end=ends[0], share=below),
        *(
            message("{low} to {high}: {share:.1f} %", low=low, high=high, share=share)
            for (low, high), share in zip(pairwise(ends), between, strict=True)
        ),
        message("above {end}: {share:.1f} %", end=ends[-1], share=above),
    ]
    keys = [f"<div>{_key(color, '■', text)}</div>" for color, text in zip(DIVERGING, said, strict=True)]
    return keys[::-1]


def _cut_words(section: Section, frame: str) -> str:
    at = {
        "axis": section.axis if section.normal is None else "n",
        "at_mm": number_text(section.at_mm, 1),
        "frame": frame,
    }
    if section.keep == "below":
        return message("Cut at {axis} = {at_mm} mm in {frame}; what lies beyond is hidden.", **at)
    return message("Cut at {axis} = {at_mm} mm in {frame}; what lies before is hidden.", **at)


def rejected_html(facts: SceneFacts) -> str:
    """Return the list of rejected captures with their reasons in full, empty if there are none."""
    rows = [f"<li><b>{escape(c.id)}</b>: {escape(c.reason)}</li>" for c in facts.captures if c.state == "rejected"]
    if not rows:
        return ""
    return f'<ul style="margin:0;padding:0 1em 0.6em 2em;font-size:0.85em;line-height:1.4">{"".join(rows)}</ul>'


def _scale(limit_mm: float) -> str:
    limit = length_text(limit_mm)
    return (
        f"<div>{_head(message('Distance to the sphere'))}{_bar(DIVERGING)}"
        f'<div class="ticks"><span>≤ −{limit}</span><span>0</span><span>≥ +{limit}</span></div>'
        f"{_sides()}</div>"
    )


def _sides() -> str:
    return f'<div class="ticks"><span>{message("inside")}</span><span>{message("outside")}</span></div>'


def _bar(colors: Sequence[Rgb]) -> str:
    stops = ", ".join(css(color) for color in colors)
    return f'<div class="bar" style="background:linear-gradient(to right, {stops})"></div>'


def _key(color: Rgb, sign: str, text: str) -> str:
    return f'<span class="key"><i style="color:{css(color)}">{sign}</i> {escape(text)}</span>'


def _head(text: str) -> str:
    return f"<h2>{escape(text)}</h2>"


def _line(text: str) -> str:
    return f"<p>{escape(text)}</p>"


def _captures(count: int) -> str:
    return plural("{count} capture", "{count} captures", by="count", count=count)
