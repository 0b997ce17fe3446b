"""An environment that has a wheel and what the wheel asks for, and nothing else: to try the wheel in."""

import os
import re
import subprocess
import sys
from pathlib import Path

LOCK = Path(__file__).resolve().parents[1] / "requirements-image.lock"
_LOCKED = re.compile(r"^[\w.-]+==[^\\\n]+", re.MULTILINE)
_INSTALLED = """import importlib.metadata, re
for d in importlib.metadata.distributions():
    print(re.sub("[-_.]+", "-", d.name).lower() + "==" + d.version)
"""


def make(place: Path, wheel: Path, of: str = sys.executable) -> Path:
    """Install a wheel in the lock's versions, from what uv has kept, else anew; return the folder of its programs.

    `of` is the Python that it is an environment of.

    Raises
    ------
    SystemExit
        If it cannot be installed: with what the installer says.
    """
    subprocess.run([of, "-m", "venv", "--without-pip", str(place)], check=True)
    programs = place / ("Scripts" if os.name == "nt" else "bin")
    constraints = place / "constraints.txt"
    constraints.write_text("\n".join(_LOCKED.findall(LOCK.read_text(encoding="utf-8"))), encoding="utf-8")
    tool, python = [sys.executable, "-m"], str(programs / "python")
    what = ["--quiet", "--constraint", str(constraints), str(wheel)]
    uv = [*tool, "uv", "pip", "install", "--python", python, *what]
    said = ""
    for command in ([*uv, "--offline"], uv, [*tool, "pip", "--python", python, "install", *what]):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == 0:
            return programs
        said = done.stderr
    sys.exit(said)


def installed(programs: Path) -> set[str]:
    """Return what is installed there, as `name==version`, the names as registries and locks write them."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = [str(programs / "python"), "-c", _INSTALLED]
    done = subprocess.run(command, cwd=programs, env=environment, capture_output=True, text=True, check=True)
    return set(done.stdout.split())
