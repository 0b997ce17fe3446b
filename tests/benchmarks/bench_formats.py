"""Scanners' files: every brand's variants, and damaged tables judged by a strict grammar of their own."""

import random
from collections import Counter
from typing import cast

import numpy as np
from harness import Row

from calib_core.errors import CalibrationError
from calib_core.formats.format import PointKind
from calib_core.formats.points import read_file
from tests.core.point_file_forms import forms
from tests.core.scanner_files import known, scanner_files
from tests.core.table_mutations import verdict_of


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes ten thousand damaged tables."""
    files = scanner_files()
    right: list[bool] = []
    for file in files:
        reading = read_file(file.data, file.name, cast("PointKind", file.kind), settings=file.settings)
        points, truth = reading.points[reading.known], known(file.truth_mm)
        right.append(points.shape == truth.shape and bool(np.abs(points - truth).max() <= file.digits_mm))
    brands = len({file.brand for file in files})
    count = 10_000 if full else 1000
    found = Counter(verdict_of(random.Random(seed))[0] for seed in range(count))
    told = f"{found['right']} right, {found['refused']} refused, {found['wrong']} wrong"
    public = forms()
    silent, refused = 0, 0
    for form in public:
        try:
            reading = read_file(form.data, form.name, form.kind, settings=form.settings)
        except CalibrationError:
            refused += 1
            continue
        points = reading.points[reading.known]
        same = points.shape == form.truth_mm.shape and np.abs(points - form.truth_mm).max() <= 2e-4
        silent += not same and not reading.doubts
        refused += bool(reading.doubts) and not form.asked
    return [
        Row(f"{brands} brands, {len(files)} variants: points right", "all", f"{sum(right)}", all(right)),
        Row(
            f"{len(public)} files after public ones' forms: misread in silence; refused or doubted without need",
            "0; 0",
            f"{silent}; {refused}",
            not silent and not refused,
        ),
        Row(f"{count:,} damaged tables", "right or refused with the line or column", told, not found["wrong"]),
    ]
