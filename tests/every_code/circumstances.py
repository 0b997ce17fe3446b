"""Rows of equipment and temperature."""

from typing import Any

from calib_core.graph.registry import STAGES
from calib_core.graph.temperature import temperature_findings
from tests.every_code.made import TCP, Case, check, session_of


def due(day: str) -> dict[str, Any]:
    return {"kind": "sphere", "serial": "S-1", "certificate": {"number": "K-1", "due": day}}


def filed(name: str) -> dict[str, Any]:
    return {"kind": "sphere", "certificate": {"number": "K-1", "file": name}}


def warm(*, told: bool = True, expansion_per_k: float | None = 11.5e-6) -> Case:
    """Return what is said of a steel ball at 24 °C; `told`: whether its temperature is."""
    sphere = {"kind": "sphere"} | ({"expansion_per_k": expansion_per_k} if expansion_per_k else {})
    captures = [{**c, **({"environment": {"ball_c": 24.0}} if told else {})} for c in TCP]
    session = session_of(captures, equipment=[sphere])
    return lambda: temperature_findings(session, STAGES.get("tcp"))


CASES: dict[str, tuple[Case, Case]] = {
    "certificate-file": (check(TCP, equipment=[filed("none.pdf")]), check(TCP, equipment=[due("2999-01-01")])),
    "certificate-overdue": (check(TCP, equipment=[due("2026-01-01")]), check(TCP, equipment=[due("2999-01-01")])),
    "length-at-temperature": (warm(), warm(expansion_per_k=None)),
    "expansion-unknown": (warm(expansion_per_k=None), warm(told=False, expansion_per_k=None)),
}
