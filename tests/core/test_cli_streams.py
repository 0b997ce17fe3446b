"""Where commands read and write: files whole or not at all, `-`, pipes; nothing else is ever replaced."""

import io
import json
import os
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from calib_core.archive.archive import verify
from server.cli import main


@pytest.fixture
def stdin(monkeypatch: pytest.MonkeyPatch):
    def give(data: bytes, is_terminal: bool = False) -> None:
        given = SimpleNamespace(buffer=io.BytesIO(data), isatty=lambda: is_terminal)
        monkeypatch.setattr(sys, "stdin", given)

    return give


def writing(solved_folder: Path, out: Path | str) -> list[list[str]]:
    return [
        ["report", str(solved_folder), "--out", str(out)],
        ["export", str(solved_folder), "--format", "json", "--out", str(out)],
        ["archive", "pack", str(solved_folder), "--no-scene", "--out", str(out)],
    ]


def test_a_link_is_neither_replaced_nor_written_through(solved_folder, tmp_path, capsys):
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("mine")
    link.symlink_to(target)
    (tmp_path / "dangling").symlink_to(tmp_path / "nothing")
    for name in (link, tmp_path / "dangling"):
        for arguments in writing(solved_folder, name):
            assert main(arguments) == 2
            assert "a link, which is not replaced" in capsys.readouterr().err
    assert link.is_symlink()
    assert target.read_text() == "mine"
    assert not (tmp_path / "nothing").exists()


def test_a_folder_is_not_replaced(solved_folder, tmp_path, capsys):
    (tmp_path / "folder").mkdir()
    for arguments in writing(solved_folder, tmp_path / "folder"):
        assert main(arguments) == 2
        assert "a folder, which is not replaced" in capsys.readouterr().err
    assert list((tmp_path / "folder").iterdir()) == []


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
def test_a_pipe_is_written_into_and_stays(solved_folder, tmp_path, capsys):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for arguments in writing(solved_folder, pipe):
        read: list[bytes] = []
        reader = threading.Thread(target=lambda into=read: into.append(pipe.read_bytes()))
        reader.start()
        assert main(arguments) == 0
        reader.join()
        assert len(read[0]) > 500
        assert pipe.is_fifo()
    assert main(["report", str(solved_folder), "--out", "/dev/null"]) == 0
    assert Path("/dev/null").is_char_device()


def test_the_results_of_a_run_replace_no_link(solved_folder, tmp_path, capsys):
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "out" / "results").mkdir(parents=True)
    (tmp_path / "out" / "results" / "tcp.json").symlink_to(tmp_path / "mine")
    assert main(["run", str(solved_folder), "--stage", "tcp", "--out", str(tmp_path / "out")]) == 2
    assert "a link" in capsys.readouterr().err
    assert (tmp_path / "mine").read_text() == "mine"


def test_an_archive_goes_through_standard_output_and_input(solved_folder, tmp_path, capsysbinary, stdin):
    assert main(["archive", "pack", str(solved_folder), "--no-scene", "--out", "-"]) == 0
    packed = capsysbinary.readouterr().out
    (tmp_path / "whole.zip").write_bytes(packed)
    assert verify(tmp_path / "whole.zip").captures
    for arguments in (["archive", "verify", "-"], ["check", "-"], ["export", "-", "--format", "json"]):
        stdin(packed)
        assert main(arguments) == 0
    assert capsysbinary.readouterr().out.startswith(b"standard input: agrees with its own checksums; signed by ")
    stdin(packed[: len(packed) // 2])
    assert main(["archive", "verify", "-"]) == 2
    assert b"standard input" in capsysbinary.readouterr().err
    stdin(b"", is_terminal=True)
    assert main(["check", "-"]) == 2
    assert b"a terminal" in capsysbinary.readouterr().err


def test_a_scan_comes_through_standard_input(capsys, stdin):
    direction = np.random.default_rng(1).standard_normal((500, 3))
    direction[:, 2] = -np.abs(direction[:, 2])
    points = 20 * direction / np.linalg.norm(direction, axis=1, keepdims=True) + [0, 0, 200]
    stdin("".join(f"{x:.4f} {y:.4f} {z:.4f}\n" for x, y, z in points).encode())
    assert main(["sphere", "-", "--format", "xyz", "--diameter-mm", "40", "--json"]) == 0
    np.testing.assert_allclose(json.loads(capsys.readouterr().out)["center_mm"], [0, 0, 200], atol=0.01)


@pytest.mark.thorough
def test_quiet_says_nothing_and_json_one_object(solved_folder, tmp_path, capsys):
    report = ["report", str(solved_folder), "--out", str(tmp_path / "r.html")]
    for arguments in (
        report,
        ["check", str(solved_folder)],
        ["archive", "pack", str(solved_folder), "--out", str(tmp_path / "z.zip")],
    ):
        assert main([*arguments, "--quiet"]) == 0
        assert capsys.readouterr() == ("", "")
        assert main([*arguments, "--json"]) == 0
        assert isinstance(json.loads(capsys.readouterr().out), dict)
    assert main(["check", str(tmp_path / "nowhere"), "--quiet"]) == 2
    assert "scancell: error:" in capsys.readouterr().err
    assert main(["export", str(solved_folder), "--format", "json", "--json"]) == 2  # both on standard output
