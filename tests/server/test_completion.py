"""The shell completes what stands in the registries: commands, options, actions, choices."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.skipif(sys.platform == "win32", reason="bash and its like")
@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("scancell si", {"simulate "}),
        ("scancell archive ver", {"verify "}),
        ("scancell run --st", {"--stage "}),
        ("scancell token create --role c", {"capture "}),
    ],
)
def test_a_word_is_completed(line: str, offered: set[str], tmp_path: Path) -> None:
    answer = tmp_path / "answer"
    asked = {
        "_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)), "_ARGCOMPLETE_IFS": "\n",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(answer),
    }  # fmt: skip
    subprocess.run([sys.executable, "-m", "server.cli"], cwd=ROOT, env=os.environ | asked, check=True)
    assert set(answer.read_text().split("\n")) == offered


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_is_one_that_the_shell_takes(shell: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "server.cli", "completion", shell],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert "scancell" in done.stdout
    if shutil.which(shell):
        subprocess.run([shell, "-n"], input=done.stdout, text=True, check=True)
