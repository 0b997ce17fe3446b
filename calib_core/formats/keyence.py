"""Keyence LJ-X and LJ-V profiles as counts: x and then a column a profile, whole numbers of 0.01 µm.

After the reference manual of the communication library ("Save file format": tab-separated, "values … saved
unmodified"): −2147483648 to −2147483645 say that there was no peak, a mask, or a dead zone.  Tables in millimetres
and height images of the same scanners are read by `table`, `grid` and `height-image`.
"""

import re
from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field

from calib_core.errors import InputError
from calib_core.formats.format import (
    NO_MATCH,
    Format,
    Match,
    PointKind,
    Reading,
    Settings,
    ending_of,
    require_kind,
)
from calib_core.formats.shared.columns import points_of
from calib_core.formats.shared.text_style import decode_text
from calib_core.formats.shared.text_table import parse_table
from calib_core.formats.shared.unnamed import Column
from calib_core.messages import message
from calib_core.records.base import Positive

_INVALID = (-2147483648.0, -2147483647.0, -2147483646.0, -2147483645.0)
_MARK = re.compile(rb"(?<![\d.])-214748364[5-8](?![\d.])")
_EXAMPLE = "x and heights as whole numbers"


class KeyenceSettings(Settings):
    """As `Settings`; `profile` is the column of heights meant, from 1; `count_mm` what a count is worth."""

    profile: Annotated[int, Field(ge=1)] | None = None
    count_mm: Positive = 1e-5


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file holds counts: by the values that stand for nothing."""
    if ending_of(name) not in FORMAT.endings or b"-21474836" not in data or not _MARK.search(data):
        return NO_MATCH
    whole = not re.search(rb"\d\.\d", data[:20_000])
    return Match(0.8, "whole numbers with −2147483648 where nothing came back") if whole else NO_MATCH


def read(data: bytes, name: str, settings: KeyenceSettings, kind: PointKind | None) -> Reading:
    """Return one profile in mm; raises InputError where several are there and none is named."""
    table = parse_table(decode_text(data, name, _EXAMPLE), name, _EXAMPLE)
    values = table.values
    while values.shape[1] > 2 and np.isnan(values[:, -1]).all():
        values = values[:, :-1]
    profiles = values.shape[1] - 1
    chosen = settings.profile or (1 if profiles == 1 else 0)
    if not 1 <= chosen <= profiles:
        got = (
            message("{profiles} profiles", profiles=profiles)
            if not settings.profile
            else message("profile {chosen} of {profiles}", chosen=chosen, profiles=profiles)
        )
        raise InputError(
            "one profile", got, message("Give the setting {named}, or export one alone.", named="profile"), name
        )
    require_kind("profile", kind, name, "x and z")
    points = values[:, [0, chosen]].copy()
    points[np.isin(points, _INVALID).any(axis=1)] = np.nan
    told = settings.model_copy(update={"unit": "mm"})
    columns = [Column("x", 0, "column 1", None), Column("z", 1, message("column {place}", place=chosen + 1), None)]
    reading = points_of(points * settings.count_mm, columns, "profile", name, told)
    unit = f"{settings.count_mm * 1000:g} µm"
    return replace(
        reading, unit=unit, unit_from="settings" if "count_mm" in settings.model_fields_set else "format"
    )


FORMAT = Format(
    name="keyence",
    title="Keyence LJ-X and LJ-V counts (TSV)",
    endings=(".csv", ".txt", ".tsv"),
    kinds=("profile",),
    recognise=recognise,
    read=read,
    settings=KeyenceSettings,
)
