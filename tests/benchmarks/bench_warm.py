"""The first run of each stage after `scancell warm` on a fresh machine, beside a later one."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from tests.benchmarks.harness import Row

_SCENARIOS = {
    "tcp": "tcp", "turntable": "turntable", "chain": "turntable", "camera": "camera",
    "laser-plane": "laser-plane", "merge": "part",
}  # fmt: skip


def run(full: bool) -> Iterator[Row]:
    """Warm an empty cache, then run each stage in processes of their own; with `full` the middle of five."""
    with tempfile.TemporaryDirectory(prefix="scancell-warm-") as name:
        place = Path(name)
        environment = os.environ | {"NUMBA_CACHE_DIR": os.environ.get("NUMBA_CACHE_DIR", str(place / "cache"))}

        def scancell(*arguments: str) -> tuple[float, str]:
            command = [sys.executable, "-m", "server.cli", *arguments]
            started = time.perf_counter()
            done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
            return time.perf_counter() - started, done.stdout

        seconds, said = scancell("warm", "--json")
        yield Row(
            "scancell warm, empty cache", "", f"{seconds:.0f} s, {json.loads(said)['compiled']} kernels", None
        )
        for stage, scenario in _SCENARIOS.items():
            session = str(place / scenario)
            if not Path(session).exists():
                scancell("simulate", scenario, "--seed", "1", "--out", session)
            command = ("run", session, "--stage", stage, "--out", str(place / "out"), "--quiet")
            first = scancell(*command)[0]
            later = sorted(scancell(*command)[0] for _ in range(5 if full else 1))
            ratio = first / later[len(later) // 2]
            yield Row(
                f"first run of {stage}", "≤ 1.5 × a later one", f"{first:.1f} s, {ratio:.2f} ×", ratio <= 1.5
            )
