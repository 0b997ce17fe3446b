"""What the name of a column means: which axis, in which unit."""

import re
from collections.abc import Sequence

from calib_core.formats.format import Unit

_WRITTEN: dict[Unit, str] = {
    "mm": "mm millimeter millimetre millimeters millimetres",
    "m": "m meter metre meters metres",
    "cm": "cm",
    "um": "um µm \u03bcm micron microns micrometer micrometre micrometers micrometres",
    "in": "in inch inches zoll",
}
_UNITS: dict[str, Unit] = {word: unit for unit, words in _WRITTEN.items() for word in words.split()}
_WORDS = "|".join(sorted((re.escape(word) for word in _UNITS), key=len, reverse=True))
_WITH_UNIT = re.compile(
    rf"(.*?)[\s_/]*[\[\(\{{<]\s*({_WORDS})\.?\s*[\]\)\}}>]\s*\Z|(.*?)[\s_/]+(?:in )?({_WORDS})\Z"
)
_UNIT_LINE = re.compile(rf"\b(?:unit|units|einheit|einheiten)\b[^\w\"]*\b({_WORDS})\b")
_NOISE = {
    "axis", "achse", "coordinate", "coord", "koordinate", "position", "pos", "value", "values", "wert", "werte",
    "data", "point", "cartesian", "profile", "profil", "world", "calibrated",
}  # fmt: skip
_AFFIXES = (("", "coord"), ("", "pos"), ("", "axis"), ("", "mm"), ("pos", ""), ("cartesian", ""))
_ALIASES = {f"{before}{axis}{after}": axis for axis in "xyz" for before, after in _AFFIXES} | {
    "easting": "x", "east": "x", "northing": "y", "north": "y", "rechtswert": "x", "hochwert": "y"
}  # fmt: skip
_LABELS = {
    "id", "point", "points", "pointid", "pointno", "pointname", "pointnumber", "name", "label", "code", "nr", "no",
    "punkt", "punktid", "punktnr", "punktnummer", "punktname", "pt", "ptid", "description", "remark", "station",
    "timestamp", "time", "date", "datetime", "zeit", "zeitstempel", "datum",
}  # fmt: skip
_HEIGHTS = {"height", "höhe", "hoehe", "elevation"}
_BRIGHTNESS = {"intensity", "intensities", "intensität", "intensitaet", "reflectance", "reflectivity"}


def unit_of(text: str) -> Unit | None:
    """Return the unit that a text is, such as ``[mm]``."""
    return _UNITS.get(text.strip().strip("[](){}<>").strip().lower())


def unit_within(text: str) -> Unit | None:
    """Return the unit in brackets within a text, such as ``Y\\X [mm]``."""
    found = re.search(rf"[\[(]\s*({_WORDS})\s*[\])]", text.lower())
    return _UNITS[found[1]] if found else None


def unit_in(lines: Sequence[str]) -> Unit | None:
    """Return the unit that a preamble states, such as ``Unit: µm``; None where it says none, or several."""
    found: set[Unit] = {_UNITS[match[1]] for line in lines for match in _UNIT_LINE.finditer(line.lower())}
    return found.pop() if len(found) == 1 else None


def axis_of(name: str) -> tuple[str | None, Unit | None]:
    """Return the axis and the unit that a column's name means: ``X [mm]``, ``z_um``, ``Höhe (µm)``."""
    text = name.strip().strip('"').strip().lower()
    unit: Unit | None = None
    if matched := _WITH_UNIT.match(text):
        text = matched[1] if matched[1] is not None else matched[3]
        unit = _UNITS[matched[2] or matched[4]]
    words = [word for word in re.split(r"[^a-zäöüß0-9]+", text) if word and word not in _NOISE]
    if len(words) != 1:
        return None, unit
    word = _ALIASES.get(words[0], words[0])
    if word in ("x", "y", "z"):
        return word, unit or ("mm" if words[0].endswith("mm") else None)
    return ("height" if word in _HEIGHTS else None), unit


def is_label(name: str) -> bool:
    """Return whether a column's name says that it has words: ``Point ID``, ``Name``, ``Timestamp``."""
    return re.sub(r"[^a-zäöüß]+", "", name.lower()) in _LABELS


def place_of_intensity(names: Sequence[str]) -> int | None:
    """Return which of the columns is named as how bright points came back; None where none is."""
    words = [re.split(r"[^a-zäöüß]+", name.lower()) for name in names]
    return next((place for place, each in enumerate(words) if _BRIGHTNESS & set(each)), None)
