"""Whether every requirement has a wheel, platform by platform and Python by Python; asks the package registry."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from harness import Row

ROOT = Path(__file__).resolve().parents[2]

PLATFORMS = {
    "Windows x64": "x86_64-pc-windows-msvc",
    "Linux x86_64, glibc 2.35": "x86_64-manylinux_2_35",
    "Linux ARM64, glibc 2.35": "aarch64-manylinux_2_35",
    "macOS ARM": "aarch64-apple-darwin",
    "Linux x86_64, glibc 2.28": "x86_64-manylinux_2_28",
}
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
NOT_PROMISED = ("Linux x86_64, glibc 2.28",)
_LACKING = re.compile(r"[Bb]ecause(?: only)? ([\w.-]+)")


def run(full: bool) -> Iterator[Row]:
    """Resolve the base requirements by wheels alone; `full` takes every Python, else the oldest and the newest."""
    pythons = PYTHONS if full else (PYTHONS[0], PYTHONS[-1])
    for name, platform in PLATFORMS.items():
        lacking = {python: what for python in pythons if (what := _lacking(platform, python))}
        told = "; ".join(f"{python}: {what}" for python, what in lacking.items())
        target = "told" if name in NOT_PROMISED else "all"
        holds = None if name in NOT_PROMISED else not lacking
        yield Row(f"{name}, Python {', '.join(pythons)}", target, f"lacks {told}" if lacking else "all", holds)


def _lacking(platform: str, python: str) -> str:
    """Return which requirement has no wheel there, nothing where all have."""
    command = [
        sys.executable,
        "-m",
        "uv",
        "pip",
        "compile",
        str(ROOT / "pyproject.toml"),
        "--quiet",
        "--no-header",
    ]
    command += ["--python-platform", platform, "--python-version", python, "--only-binary", ":all:"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not done.returncode:
        return ""
    found = _LACKING.search(done.stderr)
    return found[1] if found else " ".join(done.stderr.split())[:80]
