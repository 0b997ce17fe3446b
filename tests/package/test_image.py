"""The image's recipe and the compose file, held against the project as far as can be without a runtime."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from calib_core.archive.keys import VARIABLE as KEY_VARIABLE
from server.cli import COMMANDS, parser
from server.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
COMPOSE: dict[str, Any] = yaml.safe_load((ROOT / "compose.yaml").read_text())
BIN = Path(sys.executable).parent


def instructions() -> list[tuple[str, str]]:
    """The recipe's instructions in their order, continued lines joined, comments left out."""
    text = "\n".join(line for line in (ROOT / "Containerfile").read_text().split("\n") if not line.startswith("#"))
    lines = text.replace("\\\n", " ").split("\n")
    return [(name, rest.strip()) for name, _, rest in (line.partition(" ") for line in lines) if name]


def settings_in(names: set[str]) -> set[str]:
    ours = {name.removeprefix("SCANCELL_").lower() for name in names if name.startswith("SCANCELL_")}
    assert ours <= {*Settings.model_fields, KEY_VARIABLE.removeprefix("SCANCELL_").lower()}
    return ours


def require_command(words: list[str]) -> None:
    """A command that the image has, with arguments that it takes."""
    if words[0] == "scancell":
        assert words[1] in COMMANDS.names()
        assert parser(words[1:]).parse_args(words[1:])
    elif words[0] == "dask":
        done = subprocess.run([BIN / "dask", words[1], "--help"], capture_output=True, text=True, check=True)
        assert {word for word in words[2:] if word.startswith("--")} <= set(re.findall(r"--[\w-]+", done.stdout))
    else:
        assert words[:2] == ["python", "-c"]
        compile(words[2], "compose.yaml", "exec")


def test_what_is_copied_exists_and_reaches_the_build() -> None:
    stages: set[str] = set()
    ignored = (ROOT / ".containerignore").read_text().split("\n")
    for name, rest in instructions():
        if name == "FROM":
            image, _, stage = rest.partition(" AS ")
            assert re.fullmatch(r"docker\.io/library/python:3\.\d+-slim-\w+", image)
            stages |= {stage} - {""}
        if name == "COPY":
            *sources, _ = [word for word in rest.split() if not word.startswith("--")]
            if "--from=" in rest:
                assert re.search(r"--from=(\w+)", rest)[1] in stages  # type: ignore[index]
            else:
                assert all((ROOT / source).exists() for source in sources)
                assert all(f"!{source}" in ignored for source in sources)


def test_its_settings_and_commands_are_ours() -> None:
    given = dict(instructions())
    names = set(re.findall(r"(\w+)=", given["ENV"]))
    assert settings_in(names) == {"log"}
    assert "NUMBA_CACHE_DIR" in names
    require_command(json.loads(given["CMD"]))
    warm = ("RUN", "scancell warm --any-processor")
    assert warm in instructions()
    order = instructions()
    assert order.index(("USER", "scancell")) < order.index(
        ("RUN", "scancell warm --any-processor")
    )  # not root's cache


def locked(name: str) -> set[str]:
    text = (ROOT / f"requirements{name}.lock").read_text()
    assert not re.search("://|--index|--extra|--find", text), "a lock file names no host"
    return set(re.findall(r"^([\w.-]+==\S+)", text, re.MULTILINE))


def test_it_installs_what_the_project_needs_and_no_tools() -> None:
    tools, image, runtime = ({one.split("==")[0] for one in locked(name)} for name in ("", "-image", "-runtime"))
    assert {"numba", "fastapi", "distributed", "psycopg", "boto3", "argcomplete", "pye57"} <= image
    assert not {"pytest", "pyright", "playwright"} & image
    assert {"numba", "fastapi", "open3d-cpu", "hatchling"} <= runtime
    assert not {"pytest", "pyright", "playwright", "pye57", "distributed"} & runtime
    assert {"pytest", "pye57", "uv"} <= tools


def test_what_is_installed_has_the_versions_that_the_tests_ran_with() -> None:
    assert locked("-runtime") | locked("-image") | locked("-build") | locked("-uv") <= locked("")


def test_all_that_the_image_takes_from_a_registry_is_held_against_a_hash() -> None:
    installs = re.findall(r"pip install (.*?)(?:&&|$)", " && ".join(r for n, r in instructions() if n == "RUN"))
    assert len(installs) == 3
    for words in installs:
        assert ("--require-hashes --requirement requirements-" in words) != ("--no-deps /wheel/*.whl" in words)


def test_the_system_packages_are_those_that_make_installs() -> None:
    (install,) = [rest for name, rest in instructions() if name == "RUN" and "apt-get install" in rest]
    listed = (ROOT / ".ci" / "system-packages").read_text()
    wanted = re.search(r"recommends (.*?) &&", install)
    assert wanted is not None
    assert wanted[1].split()
    assert all(package in listed for package in wanted[1].split())


@pytest.mark.parametrize("name", COMPOSE["services"])
def test_a_service_of_the_compose_file_holds_together(name: str) -> None:
    service = COMPOSE["services"][name]
    assert set(service.get("depends_on", [])) <= COMPOSE["services"].keys()
    assert all(volume.partition(":")[0] in COMPOSE["volumes"] for volume in service.get("volumes", []))
    settings_in(set(service.get("environment", {})))
    if "build" in service:
        assert (ROOT / service["build"]["dockerfile"]).is_file()
        if "command" in service:
            require_command(service["command"])
    else:
        named = service["image"]
        assert re.search(r":[\d.]+(@sha256:[0-9a-f]{64})?$", named), "an image is named with its version"


def test_a_runtime_takes_the_compose_file_where_there_is_one() -> None:
    command = next((c for c in (["podman-compose"], ["docker", "compose"]) if _runs([*c, "version"])), None)
    if command is None:
        pytest.skip("no container runtime here")
    subprocess.run([*command, "config"], cwd=ROOT, capture_output=True, check=True)


def _runs(command: list[str]) -> bool:
    return shutil.which(command[0]) is not None and not subprocess.run(command, capture_output=True).returncode


def test_the_unit_for_systemd_starts_our_command_with_our_settings(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "examples" / "scancell.service").read_text()
    settings_in(set(re.findall(r"^Environment=(\w+)=", text, re.MULTILINE)))
    started = re.search(r"^ExecStart=(.*)$", text, re.MULTILINE)
    assert started is not None
    program, *words = started[1].split()
    require_command([Path(program).name, *words])
    assert words[words.index("--data") + 1].startswith("/var/lib/" + text.split("StateDirectory=")[1].split()[0])
    _verify("scancell", text, program, tmp_path)


@pytest.mark.parametrize("name", ["scheduler", "worker"])
def test_the_units_of_a_cluster_start_its_commands_and_again_when_they_end(name: str, tmp_path: Path) -> None:
    from click.testing import CliRunner
    from distributed.cli import dask_scheduler, dask_worker

    text = (ROOT / "docs" / "examples" / f"scancell-{name}.service").read_text()
    started = re.search(r"^ExecStart=(\S+) (\w+) (.*)$", text, re.MULTILINE)
    assert started is not None
    assert started[2] == name
    assert "Restart=always" in text
    known = {"scheduler": dask_scheduler.main, "worker": dask_worker.main}[name]
    options = {option for parameter in known.params for option in (*parameter.opts, *parameter.secondary_opts)}
    assert set(re.findall(r"--[\w-]+", started[3])) <= options
    assert CliRunner().invoke(known, ["--help"]).exit_code == 0
    settings_in(set(re.findall(r"\$\{(\w+)\}", started[3])))
    _verify(f"scancell-{name}", text, started[1], tmp_path)


def _verify(name: str, text: str, program: str, tmp_path: Path) -> None:
    if _runs(["systemd-analyze", "--version"]):
        unit = tmp_path / f"{name}.service"
        # Who verifies looks for the program, the user and what it comes after, which are not on this machine.
        there = text.replace(program, shutil.which("true") or program).replace(
            "User=scancell\nGroup=scancell\n", ""
        )
        unit.write_text(there.replace("network-online.target", "basic.target"))
        done = subprocess.run(["systemd-analyze", "verify", unit], capture_output=True, text=True)
        assert f"{name}.service:" not in done.stderr, done.stderr
