"""Tables of points in every style, then damaged, and a strict grammar of its own that judges the reader."""

import random
from dataclasses import dataclass

import numpy as np

from calib_core.errors import CalibrationError
from calib_core.formats.points import read_file

_UNITS = {"mm": 1.0, "m": 1000.0, "µm": 0.001, "inch": 25.4}
_FORMS = ("{} [{}]", "{}({})", "{}_{}", "{} in {}", "{} / {}")
_MISSING = {"": "", "NaN": "nan", "-999.0": "-999.0", "-1.#IND": "-1.#IND"}
_WORDS = ("abc", "1.2.3", "0x10", "1_0", "--5", "1e", "٣", "12,3.4")


@dataclass(frozen=True)
class Style:
    """How a table is written; the judge knows it, the reader must find it out."""

    kind: str
    separator: str
    comma: bool
    encoding: str
    end: str
    axes: tuple[str, ...]
    unit: str
    form: str | None
    missing: str


def _style(chance: random.Random) -> Style:
    kind = chance.choice(("profile", "cloud"))
    form = chance.choice((*_FORMS, *_FORMS, None))
    axes = ["x", "z"] if kind == "profile" else ["x", "y", "z"]
    if form is not None:
        axes += chance.sample(["intensity", "index", "quality"], chance.randint(0, 2))
        chance.shuffle(axes)
    separator = chance.choice((",", ";", "\t", " "))
    if separator == " ":
        form = None if form is None else "{}_{}"
    comma = separator in (";", "\t") and chance.random() < 0.5
    unit = chance.choice(tuple(_UNITS)) if form is not None else "mm"
    missing = chance.choice([m for m in _MISSING if m or separator != " "])
    encoding = chance.choice(("utf-8", "utf-8-sig", "utf-16", "cp1252"))
    return Style(kind, separator, comma, encoding, chance.choice(("\n", "\r\n")), tuple(axes), unit, form, missing)


def _lines(style: Style, chance: random.Random) -> list[str]:
    count = chance.randint(4, 40)
    z = 200 + np.array([chance.uniform(-9, 9) for _ in range(count)])
    columns = {
        "x": np.linspace(-20, 20, count), "y": np.array([chance.uniform(-30, 30) for _ in range(count)]), "z": z,
        "intensity": np.full(count, 120.0), "index": np.arange(count, dtype=float), "quality": np.full(count, 9.0),
    }  # fmt: skip
    blank = {k for k in range(count) if chance.random() < 0.2} - {0}
    digits = {"mm": 3, "m": 6, "µm": 0, "inch": 5}[style.unit]
    rows: list[str] = []
    for k in range(count):
        fields: list[str] = []
        for axis in style.axes:
            value = columns[axis][k] / (_UNITS[style.unit] if axis in "xyz" else 1)
            text = f"{value:.{digits}f}" if axis in "xyz" else f"{value:.0f}"
            fields.append(style.missing if axis == "z" and k in blank else text)
        rows.append(
            style.separator.join(f.replace(".", ",") if style.comma and "#" not in f else f for f in fields)
        )
    header: list[str] = []
    if style.form is not None:
        names = [style.form.format(a, style.unit) if a in "xyz" else a for a in style.axes]
        header = [style.separator.join(names)]
    preamble = chance.choice(([], ["Scanner export", ""], ["# made by a program"]))
    return [*preamble, *header, *rows]


def _mutated(lines: list[str], style: Style, chance: random.Random) -> tuple[str, str]:
    """Return the text after one damage, or none, and its name."""
    what = chance.choice(
        ("none", "cut", "doubled", "dropped", "swapped", "field lost", "field more", "word", "header")
    )
    body = [k for k, line in enumerate(lines) if line and not line.startswith(("#", "Scanner"))]
    place = chance.choice(body)
    fields = lines[place].split(style.separator)
    match what:
        case "doubled":
            lines = [*lines[: place + 1], *lines[place:]]
        case "dropped":
            lines = [*lines[:place], *lines[place + 1 :]]
        case "swapped":
            a, b = chance.choice(body), chance.choice(body)
            lines = list(lines)
            lines[a], lines[b] = lines[b], lines[a]
        case "field lost":
            del fields[chance.randrange(len(fields))]
        case "field more":
            fields.insert(chance.randrange(len(fields) + 1), "7")
        case "word":
            fields[chance.randrange(len(fields))] = chance.choice(_WORDS)
        case "header":
            lines = [*lines[:place], lines[0], *lines[place:]]
        case _:
            pass
    if what.startswith("field") or what == "word":
        lines = [*lines[:place], style.separator.join(fields), *lines[place + 1 :]]
    text = style.end.join(lines) + style.end
    return (text[: chance.randrange(len(text))] if what == "cut" else text), what


def _judged(text: str, style: Style) -> np.ndarray | None:
    """Return the points (N, K) that a text strictly says, None where it says none: by the style that it has."""
    lines = [
        (n, line)
        for n, line in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"))
        if line.strip()
    ]
    lines = [line for _, line in lines if not line.startswith(("#", "Scanner"))]
    names = None
    if lines and "x" in lines[0].lower() + " " and style.form is not None and not _numbers(lines[0], style):
        names = lines[0].split(style.separator)
        while lines and lines[0].split(style.separator) == names:
            lines = lines[1:]
    rows = [_numbers(line, style) for line in lines]
    if not rows or any(row is None for row in rows):
        return None
    table = [row for row in rows if row is not None]
    if len({len(row) for row in table}) != 1:
        return None
    values = np.array(table)
    axes = ("x", "z") if style.kind == "profile" else ("x", "y", "z")
    if names is None:
        most = 3 if style.kind == "profile" else 12
        return values[:, : len(axes)] if len(axes) <= values.shape[1] <= most else None
    expected = [style.form.format(a, style.unit) if style.form and a in "xyz" else a for a in style.axes]
    kept = values.shape[1] == len(names) == len(expected)
    if not kept or any(names[k] != expected[k] for k, axis in enumerate(style.axes) if axis in "xyz"):
        return None
    points = values[:, [style.axes.index(axis) for axis in axes]]
    if (points[:, -1] > 0).any():
        points[points[:, -1] == 0] = np.nan  # a height of 0, far from all others, stands for nothing
    return points * _UNITS[style.unit]


def _is_header_alone(text: str, style: Style) -> bool:
    """Return whether a text has no line of numbers, which is what a scanner writes that saw nothing."""
    return not any(row and np.isfinite(row).any() for line in text.splitlines() if (row := _numbers(line, style)))


def _numbers(line: str, style: Style) -> list[float] | None:
    fields = line.split(style.separator) if style.separator != " " else line.split()
    row: list[float] = []
    for field in fields:
        text = field.strip()
        if text in (style.missing, style.missing.replace(".", ","), "-", "Na") or (
            not text and style.separator != " "
        ):
            row.append(np.nan)
            continue
        if style.comma and "." in text:
            return None
        text = text.replace(",", ".") if style.comma else text
        if not text or not set(text) <= set("0123456789.+-eE") or not text.isascii():
            return None
        try:
            row.append(np.nan if style.missing == "-999.0" and float(text) == -999 else float(text))
        except ValueError:
            return None
    return row


def verdict_of(chance: random.Random) -> tuple[str, str]:
    """Return "right", "refused" or "wrong" for one mutated table, and what it was."""
    style = _style(chance)
    text, what = _mutated(_lines(style, chance), style, chance)
    data = text.encode("utf-8" if style.encoding == "cp1252" and not text.isascii() else style.encoding, "replace")
    said = _judged(text, style)
    story = f"{what}: {style}\n{text[:600]}"
    try:
        reading = read_file(data, "a.csv" if chance.random() < 0.5 else "a.txt", style.kind)
    except CalibrationError as error:
        if what == "none":
            return "wrong", f"refused though whole: {error}\n{story}"
        return "refused", f"{error}\n{story}"
    if reading.doubts and said is not None and len(reading.points) == len(said):
        return "refused", f"asked: {reading.doubts}\n{story}"
    if not len(reading.points) and _is_header_alone(text, style):
        return "refused", f"nothing came back: {story}"  # whoever measures in it is told so
    if said is None:
        return "wrong", f"read though damaged: {reading.sentence()}\n{story}"
    points, expected = reading.points[reading.known], said[np.isfinite(said).all(axis=1)]
    if points.shape != expected.shape or not np.allclose(points, expected, rtol=1e-9, atol=1e-9):
        return "wrong", f"other points: {reading.sentence()} {reading.notes}\n{story}"
    return "right", story
