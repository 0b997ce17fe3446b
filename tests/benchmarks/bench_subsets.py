"""Few captures, or many of one pose: is the answer in the right place, and is anything accused that is right?"""

from collections.abc import Sequence

import numpy as np
from bench_halves import DATA, SETS, opened
from harness import Row, kept

from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult
from tests.trouble import all_troubles, troubled

ACCUSES = {
    "changed-tool", "moved-sphere", "pose-list-order", "pose-reading", "poses-do-not-fit", "scaled-profile",
    "shifted-poses", "sphere-diameter", "swapped-poses",
}  # fmt: skip
_FEWEST = 6
_SIGMAS = 3.5


def run(full: bool) -> list[Row]:
    """Return the rows; `full` draws 150 subsets of each set, otherwise 40."""
    found = half_alike(200 if full else 40)
    if not DATA.is_dir():
        return [*found, Row("real sets beside the project (../shared/data)", "", "not there")]
    return [*found, *(row for name in SETS for row in subsets(name, 150 if full else 40))]


def half_alike(count: int) -> list[Row]:
    """Return how many cells of 14 captures, seven of nearly one pose, are solved in the right place."""
    near, accused = 0, list[str]()
    for seed in range(count):
        cell = troubled(all_troubles()["books: half of 14 poses alike"], seed)
        result = solve_stage(cell.session, "tcp", cell.files.__getitem__)
        assert isinstance(result, TcpResult)
        off = np.array(result.tool0_from_laser)[:3, 3] - cell.tool0_from_laser[:3, 3]
        near += bool(np.linalg.norm(off) < _SIGMAS * np.sqrt(np.trace(np.array(result.covariance)[3:, 3:])))
        accused += {finding.code for finding in result.findings} & ACCUSES
    return _rows("half of 14 poses alike, simulated cells", count, near, accused)


def subsets(name: str, count: int) -> list[Row]:
    """Return how many subsets of a set, every other one a half of it, have a tool near the whole set's."""
    session, _ = opened(name)
    every = range(len(session.captures))
    rng = np.random.default_rng(2026)
    whole = _solved(name, every)
    near, nowhere, accused = 0, 0, list[str]()
    for n in range(count):
        size = len(every) // 2 if n % 2 == 0 else int(rng.integers(_FEWEST, len(every)))
        some = sorted(rng.choice(len(every), size, replace=False).tolist())
        place, far, codes = kept(f"subset-{name}-{n}", lambda some=some: _ended(name, some))
        nowhere += place is None
        off = np.linalg.norm(np.array(place) - np.array(whole.tool0_from_laser)[:3, 3]) if place else np.inf
        near += bool(off < far)
        accused += set(codes) & ACCUSES
    return _rows(f"{name}: halves and subsets", count, near, accused, nowhere)


def _rows(what: str, count: int, near: int, accused: Sequence[str], nowhere: int = 0) -> list[Row]:
    """Return the rows; an answer that states no place, as few captures may not tell one, is not wrong."""
    stood = f"{near} of {count}" + (f", {nowhere} state no place" if nowhere else "")
    told = f"{len(accused)} of {count}" + "".join(f", {code}" for code in sorted(set(accused)))
    return [
        Row(f"{what}: right within their ±", "≥ 99 %", stood, near + nowhere >= 0.99 * count),
        Row(f"{what}: something accused that is right", "none", told, not accused),
    ]


def _ended(name: str, some: Sequence[int]) -> tuple[list[float] | None, float | None, list[str]]:
    """Return a subset's place where it states one, how far off it is still right, mm, and its codes."""
    one = _solved(name, some)
    place = np.array(one.tool0_from_laser)[:3, 3]
    far = float(_SIGMAS * np.sqrt(np.trace(np.array(one.covariance)[3:, 3:])))
    codes = [finding.code for finding in one.findings]
    return (place.tolist(), far, codes) if np.isfinite([*place, far]).all() else (None, None, codes)


def _solved(name: str, some: Sequence[int]) -> TcpResult:
    session, read = opened(name)
    session = session.model_copy(update={"captures": tuple(session.captures[k] for k in some)})
    result = solve_stage(session, "tcp", read)
    assert isinstance(result, TcpResult)
    return result
