"""Rows of several spheres in one cell."""

from functools import cache

from calib_core.findings import Finding
from calib_core.stages.pipeline import solve_stage
from tests.every_code.captures import of_reflection
from tests.every_code.made import Case
from tests.plates import told_plate


@cache
def _plate(names: str, balls: int, pair: str, mm: float) -> list[Finding]:
    told = {"sphere_distances": [{"between": [*pair], "mm": mm, "sigma_mm": 0.01}]} if pair else {}
    session, files, _ = told_plate(names, balls, **told)
    return solve_stage(session, "tcp", files.__getitem__).findings


def plate(names: str, balls: int = 3, between: str = "", mm: float = 0.0) -> Case:
    """Return what the tcp stage says of a plate of three spheres, told as so many, with a distance."""
    return lambda: _plate(names, balls, between, mm)


@cache
def _misread(names: str) -> list[Finding]:
    session, files, _ = told_plate(names)
    captures = session.captures
    told = [
        c.model_copy(update={"pose": other.pose}) for c, other in zip(captures, reversed(captures), strict=True)
    ]
    session = session.model_copy(update={"captures": told})
    return solve_stage(session, "tcp", files.__getitem__).findings


CASES: dict[str, tuple[Case, Case]] = {
    "balls-not-told-apart": (lambda: _misread("abc"), lambda: _misread("")),
    "spheres-not-all-seen": (plate("abcd"), plate("abc")),
    "spheres-more-than-told": (plate("ab"), plate("abc")),
    "sphere-distances-not-used": (plate("abc", between="ab", mm=80.0), plate("abc")),
    "spheres-named-either-way": (plate("ab", 2, "ab", 61.984), plate("ab", 2)),
    "capture-with-reflection": (of_reflection(5), of_reflection()),
}
