"""`scancell bench`: the benchmarks of the checkout, as a table."""

import argparse
import importlib.util
import sys
from pathlib import Path
from typing import Any

from server.console.command import NOT_ACCEPTED, OK, Command
from server.console.output import print_result

_FOLDER = Path(__file__).resolve().parents[2] / "tests" / "benchmarks"


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("names", nargs="*", metavar="NAME", help="which ones (default all)")
    parser.add_argument("--write", action="store_true", help="keep the figures, in docs/figures.md")
    parser.add_argument("--full", action="store_true", help="with all seeds and sizes: takes minutes")


def _run(options: argparse.Namespace) -> int:
    """Run benchmarks and print their figures as they are found; return 1 where one does not hold."""
    from calib_core.errors import InputError

    known = {path.stem.removeprefix("bench_"): path for path in sorted(_FOLDER.glob("bench_*.py"))}
    if not known:
        raise InputError("the benchmarks", "none", "Run this command in a checkout of the project.", str(_FOLDER))
    for name in options.names:
        if name not in known:
            raise InputError.unknown(name, known, "bench")
    table: dict[str, list[dict[str, Any]]] = {}
    for name in options.names or known:
        if not options.json:
            print_result(options, f"\n{name}", None)
        table[name] = []
        for row in _load(known[name]).run(options.full):
            table[name].append(
                {"what": row.what, "target": row.target, "measured": row.measured, "holds": row.holds}
            )
            mark = {True: "holds", False: "FAILS", None: ""}[row.holds]
            if not options.json:
                print_result(options, f"  {row.what:58} {row.target:>22} {row.measured:>26}  {mark}", None)
    if options.json:
        print_result(options, "", table)
    if options.write:
        figures = _load(_FOLDER / "figures.py")
        kept = figures.read()
        for name, rows in table.items():
            kept = figures.measured_anew(kept, name, rows, options.full)
        figures.write(kept)
    return NOT_ACCEPTED if any(row["holds"] is False for rows in table.values() for row in rows) else OK


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


COMMAND = Command("bench", "run the benchmarks, side by side with peers", "installation", _arguments, _run)
