import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from calib_core import __version__
from calib_core.simulation import simulate
from server.cli import main, parser
from tests.benchmarks.harness import Row

ROOT = Path(__file__).resolve().parents[2]


def test_help_names_every_command(capsys):
    assert main(["--help"]) == 0
    out = capsys.readouterr().out
    for name in ("run", "check", "export", "sphere", "simulate", "schema", "bench", "serve", "demo"):
        assert f"\n    {name} " in out


def test_help_imports_nothing_heavy():
    code = (
        "import sys\nfrom server.cli import main\nmain(['--help'])\n"
        "heavy = {'numpy', 'scipy', 'pydantic', 'fastapi', 'rich', 'cv2', 'numba', 'viser', 'open3d'}\n"
        "sys.exit(str(heavy & set(sys.modules)) if heavy & set(sys.modules) else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_installed_command_answers():
    command = Path(sys.executable).parent / "scancell"
    done = subprocess.run([command, "--version"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (
        0,
        f"scancell {__version__} (Python {platform.python_version()}, {sys.platform})\n",
        "",
    )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "COMMAND"),
        (["run"], "SESSION"),
        (["walk"], "invalid choice: 'walk'"),
        (["run", "x", "--fast"], "unrecognized arguments: --fast"),
        (["run", "x", "--stages", "tcp"], "did you mean --stage?). See scancell run --help"),
        (["simulate", "tcp", "--seed", "x", "--out", "d"], "invalid int value: 'x'"),
        (["export", "x"], "--format"),
    ],
)
def test_a_usage_error_is_one_sentence(capsys, arguments, said):
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert err.count("\n") == 1
    assert err.endswith("--help.\n")


def test_a_fault_of_the_program_shows_no_traceback_unless_asked(capsys, monkeypatch):
    monkeypatch.setattr("server.commands.schema.records.schema_text", lambda _name: [][0])
    assert main(["schema", "session"]) == 2
    err = capsys.readouterr().err
    assert err.startswith("scancell: unexpected error, a fault of the program (IndexError")
    assert err.count("\n") == 1
    with pytest.raises(IndexError):
        main(["schema", "session", "--debug"])


@pytest.mark.thorough
def test_whoever_stops_reading_is_no_error(tmp_path):
    command = f'"{sys.executable}" -m server.cli schema session | head -c 1'
    done = subprocess.run(
        ["sh", "-c", command], cwd=ROOT, capture_output=True, text=True, check=False, env={**os.environ}
    )
    assert (done.stdout, done.stderr) == ("{", "")


def test_simulate_writes_the_session_and_the_same_seed_the_same_bytes(tmp_path, capsys):
    for name in ("a", "b"):
        assert main(["simulate", "tcp", "--seed", "7", "--out", str(tmp_path / name)]) == 0
    assert "14 captures" in capsys.readouterr().out
    files = {p.relative_to(tmp_path / "a"): p.read_bytes() for p in (tmp_path / "a").rglob("*") if p.is_file()}
    assert {Path("session.json"), Path("truth.json")} <= files.keys()
    assert all((tmp_path / "b" / name).read_bytes() == content for name, content in files.items())
    simulated = simulate("tcp", 7)
    assert all(files[Path(name)] == content for name, content in simulated.files.items())
    assert json.loads(files[Path("truth.json")])["tool0_from_laser"] == simulated.truth["tool0_from_laser"]


def test_simulate_never_overwrites_another_session(tmp_path, capsys):
    assert main(["simulate", "tcp", "--seed", "7", "--out", str(tmp_path)]) == 0
    before = (tmp_path / "session.json").read_bytes()
    assert main(["simulate", "tcp", "--seed", "8", "--out", str(tmp_path)]) == 2
    assert "Choose another folder" in capsys.readouterr().err
    assert (tmp_path / "session.json").read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(["walk", "--seed", "1"], "need one of tcp"), (["tcp", "--seed", "-1"], "-1")],
)
def test_simulate_names_what_it_knows(tmp_path, capsys, arguments, said):
    assert main(["simulate", *arguments, "--out", str(tmp_path)]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def sphere_cloud(scale=1.0):
    noise = np.random.default_rng(3)
    direction = noise.standard_normal((2000, 3))
    direction[:, 2] = -np.abs(direction[:, 2])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return ([10.0, 20.0, 300.0] + 25.0 * direction + 0.01 * noise.standard_normal((2000, 3))) * scale


def test_sphere_of_a_cloud(tmp_path, capsys):
    np.save(tmp_path / "c.npy", sphere_cloud())
    assert main(["sphere", str(tmp_path / "c.npy"), "--diameter-mm", "50", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(found["center_mm"], [10, 20, 300], atol=5 * 0.01 / np.sqrt(2000 / 6))
    assert found["radius_mm"] == 25
    assert found["rms_mm"] == pytest.approx(0.01, rel=0.1)
    assert 1900 < found["inliers"] <= 2000
    assert np.shape(found["covariance"]) == (3, 3)


def test_sphere_in_metres_is_named_and_read_with_its_unit(tmp_path, capsys):
    file = str(tmp_path / "c.npy")
    np.save(file, sphere_cloud(0.001))
    assert main(["sphere", file, "--diameter-mm", "50"]) == 2
    err = capsys.readouterr().err
    assert file in err
    assert "look like metres" in err
    assert main(["sphere", file, "--diameter-mm", "50", "--unit", "m", "--json"]) == 0
    np.testing.assert_allclose(json.loads(capsys.readouterr().out)["center_mm"], [10, 20, 300], atol=0.01)
    assert main(["sphere", file, "--json"]) == 0  # nothing to compare with: the radius itself is told
    assert "look like metres" in capsys.readouterr().err


def test_sphere_of_a_profile_gives_both_sides(tmp_path, capsys):
    x = np.arange(-12, 12, 0.1)
    z = 200 - np.sqrt(15**2 - x**2) + 0.01 * np.random.default_rng(4).standard_normal(len(x))
    rows = "".join(f"{a:.3f},{b:.4f},0\n" for a, b in zip(x + 3, z, strict=True))
    (tmp_path / "p.csv").write_text(rows)
    assert main(["sphere", str(tmp_path / "p.csv"), "--diameter-mm", "40", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(found["center_mm"], [3, 200], atol=0.02)
    y = np.sqrt(20**2 - found["radius_mm"] ** 2)
    np.testing.assert_allclose(
        found["sphere_center_mm"],
        [[found["center_mm"][0], side * y, found["center_mm"][1]] for side in (1, -1)],
    )
    assert main(["sphere", str(tmp_path / "p.csv")]) == 0
    assert "radius  15.0" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nothing.xyz"], "no such file"),
        (["c.stl"], ".stl"),
        (["flat.csv", "--diameter-mm", "40"], "flat.csv: need"),
        (["flat.csv", "--diameter-mm", "-1"], "a positive diameter"),
    ],
)
def test_sphere_says_what_is_wrong(tmp_path, capsys, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    Path("c.stl").write_bytes(b"solid")
    Path("flat.csv").write_text("".join(f"{x},{200 + (x % 3) / 100}\n" for x in range(-30, 30)))
    assert main(["sphere", *arguments]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


def test_bench_fails_where_a_figure_does_not_hold(capsys, monkeypatch):
    class Module:
        @staticmethod
        def run(full):
            return [Row("speed", "≥ 4", "5" if full else "3", full)]

    monkeypatch.setattr("server.commands.bench._load", lambda _path: Module)
    assert main(["bench", "tcp"]) == 1
    assert "FAILS" in capsys.readouterr().out
    assert main(["bench", "tcp", "--full", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["tcp"][0]["holds"] is True
    assert main(["bench", "nothing"]) == 2
    assert "bench: need one of" in capsys.readouterr().err


def test_serve_refuses_a_taken_port(capsys, tmp_path):
    import socket

    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert main(["serve", "--port", port, "--data", str(tmp_path)]) == 2
    assert "already in use" in capsys.readouterr().err
    assert main(["serve", "--port", "70000", "--data", str(tmp_path)]) == 2
    assert "a port from 0 to 65535" in capsys.readouterr().err


@pytest.mark.parametrize("words", [["--json", "frames"], ["frames", "--json"], ["--json", "archive", "verify"]])
def test_common_options_stand_before_a_commands_name_or_after_it(words):
    options = parser(words).parse_args([*words, "somewhere"])
    assert (options.json, options.quiet, options.debug) == (True, False, False)


def test_poses_are_planned_by_raw_frames_of_the_ball_too(tmp_path, capsys):
    cell = tmp_path / "cell"
    assert main(["simulate", "frames-tcp-known", "--seed", "3", "--out", str(cell)]) == 0
    capsys.readouterr()
    assert main(["next", str(cell), "--count", "2", "--json"]) == 0
    planned = json.loads(capsys.readouterr().out)
    assert [one["uncertainty_mm"] < 0.3 for one in planned["poses"]] == [True, True]
