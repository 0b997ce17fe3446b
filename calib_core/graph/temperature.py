"""The sphere and the ball bar as long as they were when they were captured.

A certificate holds at 20 °C (ISO 1), or at the `reference_c` that it names; a length grows by its expansion with
every kelvin.  Stages are solved with the lengths at the captures' temperature, so that a cell gives the same
answer in summer and in winter.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from calib_core.findings.codes.circumstances import EXPANSION_UNKNOWN, LENGTH_AT_TEMPERATURE
from calib_core.graph.stage import Stage
from calib_core.records import Capture, Cell, Finding, Session
from calib_core.records.sphere_class import diameter_sigma_mm
from calib_core.steps import steps_that_show

_REFERENCE_C: Final = 20.0
_THERMOMETER_SIGMA_K: Final = 0.5
"""Of a body's temperature as people take it: a contact thermometer on its stem."""
_EXPANSION_SIGMA: Final = 0.1 / np.sqrt(3)
"""Of a material's expansion from a table: within ± 10 %, all values alike (JCGM 100, 4.3.7)."""


@dataclass(frozen=True)
class Expanded:
    """A length at the temperature of its captures.

    Attributes
    ----------
    kind : str
        Of the equipment: `sphere` or `bar`.
    length_mm, sigma_mm : float
        At that temperature, with what temperature and expansion add to its standard uncertainty.
    change_mm : float
        What it is longer than as certified.
    temperature_c : float
        The mean over the captures.
    """

    kind: str
    length_mm: float
    sigma_mm: float
    change_mm: float
    temperature_c: float


def at_temperature(session: Session, steps: Iterable[str]) -> Session:
    """Return a session whose sphere and ball bar are as long as in the captures of some steps, as far as told."""
    cell = session.cell
    for one in _expanded(session, steps):
        if one.kind == "sphere":
            told = {"sphere_diameter_mm": one.length_mm, "sphere_diameter_sigma_mm": one.sigma_mm}
            cell = cell.model_copy(update=told)
        else:
            bar = {"ball_bar_mm": one.length_mm, "ball_bar_sigma_mm": one.sigma_mm}
            cell = cell.model_copy(update={"verification": cell.verification.model_copy(update=bar)})
    return session if cell is session.cell else session.model_copy(update={"cell": cell})


def temperature_findings(session: Session, stage: Stage) -> list[Finding]:
    """Return what a stage's result says of the temperature that its lengths are for."""
    reads = stage.reads_of_cell(session)
    fields = {"sphere": "sphere_diameter_mm", "bar": "verification"}
    read = {kind for kind, field in fields.items() if field in reads}
    found = [
        LENGTH_AT_TEMPERATURE(
            where="cell.equipment",
            kind=one.kind,
            length_mm=one.length_mm,
            change_um=1e3 * one.change_mm,
            temperature_c=one.temperature_c,
            sigma_mm=one.sigma_mm,
        )
        for one in _expanded(session, stage.takes)
        if one.kind in read
    ]
    warm = _ball_temperatures(session, stage.takes)
    if "sphere" in read and warm and _expansion(session.cell, "sphere") is None:
        found.append(EXPANSION_UNKNOWN(where="cell.equipment", temperature_c=float(np.mean(warm))))
    return found


def _expanded(session: Session, steps: Iterable[str]) -> Iterator[Expanded]:
    temperatures = _ball_temperatures(session, steps)
    if not temperatures:
        return
    cell, mean_c = session.cell, float(np.mean(temperatures))
    lengths = {
        "sphere": (cell.sphere_diameter_mm, diameter_sigma_mm(cell)),
        "bar": (cell.verification.ball_bar_mm, cell.verification.ball_bar_sigma_mm or 0.0),
    }
    for kind, (length_mm, sigma_mm) in lengths.items():
        expansion = _expansion(cell, kind)
        if length_mm is None or expansion is None:
            continue
        per_k, reference_c = expansion
        change_mm = length_mm * per_k * (mean_c - reference_c)
        of_temperature = length_mm * per_k * np.hypot(_THERMOMETER_SIGMA_K, np.std(temperatures))
        sigma_mm = float(np.hypot(sigma_mm, np.hypot(of_temperature, _EXPANSION_SIGMA * change_mm)))
        yield Expanded(kind, length_mm + change_mm, sigma_mm, change_mm, mean_c)


def _expansion(cell: Cell, kind: str) -> tuple[float, float] | None:
    """Return a piece's expansion per kelvin and the temperature of its certificate; None where it is not told."""
    told = [one for one in cell.equipment or () if one.kind == kind and one.expansion_per_k is not None]
    if not told or told[0].expansion_per_k is None:
        return None
    reference_c = told[0].reference_c
    return told[0].expansion_per_k, _REFERENCE_C if reference_c is None else reference_c


def _ball_temperatures(session: Session, steps: Iterable[str]) -> list[float]:
    """Return the ball's temperatures, one a capture of it that counts; those of the session where it has none."""
    shown = {*steps} & {*steps_that_show("sphere", "sphere-on-table")}
    used = [capture for capture in session.captures if capture.step in shown and not capture.excluded]
    found = [_ball_c(capture, session) for capture in used]
    return [value for value in found if value is not None]


def _ball_c(capture: Capture, session: Session) -> float | None:
    for told in (capture.environment, session.environment):
        if told is not None and told.ball_c is not None:
            return told.ball_c
    return None
