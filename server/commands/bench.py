"""`scancell bench`: the benchmarks of the checkout, as a table."""

import importlib.util
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from calib_core.errors import InputError

_FOLDER = Path(__file__).resolve().parents[2] / "tests" / "benchmarks"


def bench(names: Sequence[str], full: bool) -> int:
    """Run benchmarks and print their figures; return 1 where one does not hold."""
    known = {path.stem.removeprefix("bench_"): path for path in sorted(_FOLDER.glob("bench_*.py"))}
    if not known:
        raise InputError("the benchmarks", "none", "Run this command in a checkout of the project.", str(_FOLDER))
    for name in names:
        if name not in known:
            raise InputError("a benchmark among " + ", ".join(known), f"'{name}'", "Name one of these.", "bench")
    holds = True
    for name in names or known:
        print(f"\n{name}", flush=True)
        for row in _load(known[name]).run(full):
            mark = {True: "holds", False: "FAILS", None: ""}[row.holds]
            print(f"  {row.what:58} {row.target:>22} {row.measured:>26}  {mark}", flush=True)
            holds = holds and row.holds is not False
    return 0 if holds else 1


def _load(path: Path) -> Any:
    for folder in (str(_FOLDER.parents[1]), str(_FOLDER)):  # benchmarks share a harness that stands beside them
        if folder not in sys.path:
            sys.path.insert(0, folder)
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module
