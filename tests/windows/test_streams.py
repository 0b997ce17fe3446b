"""Standard streams in the code page of a country: nothing is lost to a sign that it lacks."""

import io
import json
import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from server.cli import main

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cells") / "Zelle ü 4"
    assert main(["simulate", "tcp", "--seed", "3", "--out", str(folder), "--quiet"]) == 0
    return folder


class Terminal(io.BytesIO):
    def isatty(self) -> bool:
        return True


class Full(io.RawIOBase):
    """A disk on which nothing has room."""

    def writable(self) -> bool:
        return True

    def write(self, _: object) -> int:
        raise OSError(28, "No space left on device")


class Unread(io.TextIOWrapper):
    """A pipe of Windows whose reader has gone: what is printed is refused as an argument that is not valid."""

    def write(self, _: str) -> int:
        raise OSError(22, "Invalid argument")


def printed(arguments: list[str], encoding: str = "cp1252", raw: io.BytesIO | None = None) -> tuple[int, bytes]:
    """Run a command whose standard output is opened as Windows opens it; return the exit status and the bytes."""
    written = raw or io.BytesIO()
    stream = io.TextIOWrapper(written, encoding=encoding, newline="\n")
    with redirect_stdout(stream):
        status = main(arguments)
    stream.flush()
    return status, written.getvalue()


@pytest.mark.parametrize("more", [[], ["--json"]])
def test_a_run_into_a_pipe_of_cp1252_is_stored_and_printed(cell: Path, more: list[str]) -> None:
    stored = cell / "results" / "tcp.json"
    stored.unlink(missing_ok=True)
    status, content = printed(["run", str(cell), *more])
    assert (status, json.loads(stored.read_text("utf-8"))["verdict"]) == (0, "pass")
    assert "σ" in content.decode("utf-8")
    if more:
        assert json.loads(content)["results"]["tcp"]["verdict"] == "pass"


def test_results_are_stored_before_they_are_printed(cell: Path) -> None:
    stored = cell / "results" / "tcp.json"
    stored.unlink(missing_ok=True)
    with redirect_stdout(io.TextIOWrapper(Full(), write_through=True)):  # type: ignore[type-var]
        assert main(["run", str(cell)]) == 2
    assert stored.is_file()


def test_what_cannot_be_stored_is_printed(cell: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    status, content = printed(["run", str(cell), "--out", str(tmp_path / "file"), "--json"])
    assert status == 2
    assert json.loads(content)["results"]["tcp"]["verdict"] == "pass"


def test_a_terminal_of_another_code_page_shows_what_it_can(cell: Path) -> None:
    status, content = printed(["run", str(cell)], "cp850", Terminal())
    assert status == 0
    assert "\\u03c3" in content.decode("cp850")  # σ, which that page lacks
    assert "°" in content.decode("cp850")


def test_an_encoding_that_was_asked_for_is_kept(cell: Path) -> None:
    settings = {**os.environ, "PYTHONIOENCODING": "cp1252", "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "server.cli", "check", str(cell.with_name("Zelle ß"))]
    done = subprocess.run(command, env=settings, capture_output=True, check=False)
    assert "Zelle ß" in done.stderr.decode("cp1252")


def test_a_program_without_a_console_runs(cell: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as streams:
        streams.setattr(sys, "stdout", None)
        streams.setattr(sys, "stderr", None)
        assert main(["check", str(cell)]) == 0
        assert main(["check", str(cell / "none")]) == 2
        sys.stdout.close()
        sys.stderr.close()


def test_who_stops_reading_is_no_error(cell: Path) -> None:
    errors = io.StringIO()
    reading, writing = os.pipe()
    with (
        os.fdopen(reading),
        Unread(os.fdopen(writing, "wb")) as pipe,
        redirect_stdout(pipe),
        redirect_stderr(errors),
    ):
        assert main(["check", str(cell)]) == 0
    assert errors.getvalue() == ""
