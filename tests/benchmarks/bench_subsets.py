"""Few captures, or many of one pose: is the answer in the right place, and is anything accused that is right?"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from bench_halves import DATA, SETS, opened
from harness import Row, all_kept

from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult
from tests.trouble import all_troubles, troubled

ACCUSES = {
    "changed-tool", "moved-sphere", "pose-list-order", "pose-reading", "poses-do-not-fit", "scaled-profile",
    "shifted-poses", "sphere-diameter", "swapped-poses",
}  # fmt: skip
_End = tuple[list[float] | None, float | None, list[str]]
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
    ends = all_kept({f"alike-{seed}": partial(_alike, seed) for seed in range(count)})
    near, accused = sum(right for right, _ in ends), [code for _, codes in ends for code in codes]
    return _rows("half of 14 poses alike, simulated cells", len(ends), near, accused) if ends else []


def _alike(seed: int) -> tuple[bool, list[str]]:
    """Return whether a cell is solved in the right place, and what it accuses."""
    cell = troubled(all_troubles()["books: half of 14 poses alike"], seed)
    result = solve_stage(cell.session, "tcp", cell.files.__getitem__)
    assert isinstance(result, TcpResult)
    off = np.array(result.tool0_from_laser)[:3, 3] - cell.tool0_from_laser[:3, 3]
    right = bool(np.linalg.norm(off) < _SIGMAS * np.sqrt(np.trace(np.array(result.covariance)[3:, 3:])))
    return right, sorted({finding.code for finding in result.findings} & ACCUSES)


def subsets(name: str, count: int) -> list[Row]:
    """Return how many subsets of a set, every other one a half of it, have a tool near the whole set's."""
    session, _ = opened(name)
    every = range(len(session.captures))
    rng = np.random.default_rng(2026)
    whole = _solved(name, every)
    steps: dict[str, Callable[[], _End]] = {}
    for n in range(count):
        size = len(every) // 2 if n % 2 == 0 else int(rng.integers(_FEWEST, len(every)))
        some = sorted(rng.choice(len(every), size, replace=False).tolist())
        steps[f"subset-{name}-{n}"] = partial(_ended, name, some)
    near, nowhere, accused = 0, 0, list[str]()
    ends = all_kept(steps)
    for place, far, codes in ends:
        nowhere += place is None
        off = np.linalg.norm(np.array(place) - np.array(whole.tool0_from_laser)[:3, 3]) if place else np.inf
        near += bool(far is not None and off < far)
        accused += set(codes) & ACCUSES
    return _rows(f"{name}: halves and subsets", len(ends), near, accused, nowhere) if ends else []


def _rows(what: str, count: int, near: int, accused: Sequence[str], nowhere: int = 0) -> list[Row]:
    """Return the rows; an answer that states no place, as few captures may not tell one, is not wrong."""
    stood = f"{near} of {count}" + (f", {nowhere} state no place" if nowhere else "")
    told = f"{len(accused)} of {count}" + "".join(f", {code}" for code in sorted(set(accused)))
    return [
        Row(f"{what}: right within their ±", "≥ 99 %", stood, near + nowhere >= 0.99 * count),
        Row(f"{what}: something accused that is right", "none", told, not accused),
    ]


def _ended(name: str, some: Sequence[int]) -> _End:
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
