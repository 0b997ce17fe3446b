"""The first run of each stage after `scancell warm` on a fresh machine, beside a later one, in processor time.

With `NUMBA_CACHE_DIR` set to a folder that `scancell warm` has filled, the stages alone are measured.
"""

import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.benchmarks.harness import Row

_SCENARIOS = {
    "tcp": "tcp", "turntable": "turntable", "chain": "turntable", "camera": "camera",
    "laser-plane": "laser-plane", "verify": "verify", "merge": "part",
}  # fmt: skip


def run(full: bool) -> Iterator[Row]:
    """Warm an empty cache, then run each stage in processes of their own; with `full` the middle of five."""
    with tempfile.TemporaryDirectory(prefix="scancell-warm-") as name:
        place = Path(name)
        environment = os.environ | {"NUMBA_CACHE_DIR": os.environ.get("NUMBA_CACHE_DIR", str(place / "cache"))}

        def scancell(*arguments: str) -> tuple[float, str]:
            command = [sys.executable, "-m", "server.cli", *arguments]
            before_s = _processor_s()
            done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
            return _processor_s() - before_s, done.stdout

        def measured_anew(session: str, command: tuple[str, ...]) -> float:
            shutil.rmtree(Path(session) / ".scancell", ignore_errors=True)  # else a later run measures nothing
            return scancell(*command)[0]

        seconds, said = scancell("warm", "--json")
        warm = json.loads(said)
        done = f"{warm['compiled']} kernels, {warm['seconds']:.0f} s, {seconds:.0f} s of the processor"
        yield Row("scancell warm, empty cache", "", done, None)
        for stage, scenario in _SCENARIOS.items():
            session = str(place / scenario)
            if not Path(session).exists():
                scancell("simulate", scenario, "--seed", "1", "--out", session)
            command = ("run", session, "--stage", stage, "--out", str(place / "out"), "--quiet")
            first, *later = (measured_anew(session, command) for _ in range(6 if full else 2))
            later.sort()
            ratio = first / later[len(later) // 2]
            yield Row(
                f"first run of {stage}", "≤ 1.5 × a later one", f"{first:.1f} s, {ratio:.2f} ×", ratio <= 1.5
            )


def _processor_s() -> float:
    """Return the processor's time of all processes that have been waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
