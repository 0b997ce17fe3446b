"""Commands with --server: the same words and the same exit status as on a folder."""

import json
from pathlib import Path

import httpx
import pytest

from server.cli import main
from tests.server.access import bearer, guarded
from tests.server.live_server import simulated_session

Printed = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("cell") / "cell"
    assert main(["simulate", "tcp", "--seed", "5", "--out", str(place)]) == 0
    return place


def site(client: httpx.Client) -> str:
    return str(client.base_url).removesuffix("/api/v1/")


@pytest.mark.thorough
def test_a_folder_is_sent_solved_and_looked_at(
    client: httpx.Client, folder: Path, tmp_path: Path, capsys: Printed
) -> None:
    server = ["--server", site(client)]
    assert main(["run", str(folder), *server, "--json"]) == 0
    solved = json.loads(capsys.readouterr().out)
    session = solved["session"]["id"]
    assert solved["results"]["tcp"]["verdict"] == "pass"
    assert main(["answer", session, *server, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (
        answer["tool0_from_laser"]["matrix"]
        == client.get(f"/sessions/{session}/answer").json()["tool0_from_laser"]["matrix"]
    )
    assert main(["check", session, *server]) == 0
    assert main(["export", session, *server, "--format", "json", "--out", str(tmp_path / "tool.json")]) == 0
    assert json.loads((tmp_path / "tool.json").read_text())["stale"] is False
    assert main(["report", session, *server, "--out", str(tmp_path / "report.html")]) == 0
    assert "<html" in (tmp_path / "report.html").read_text()
    client.patch(f"/sessions/{session}/captures/p03", json={"excluded": True})
    assert main(["answer", session, *server]) == 1
    assert main(["export", session, *server, "--format", "json"]) == 1
    capsys.readouterr()


def test_a_session_is_found_by_its_name_where_only_one_has_it(client: httpx.Client, capsys: Printed) -> None:
    names = [simulated_session(client, captures=1) for _ in range(2)]
    for number, session in enumerate(names):
        client.patch(f"/sessions/{session}", json={"name": f"named {min(number, 0)}"})
    server = ["--server", site(client)]
    assert main(["check", "named 0", *server]) == 2
    assert "2 sessions of this name" in capsys.readouterr().err
    client.patch(f"/sessions/{names[1]}", json={"name": "named 1"})
    assert main(["check", "named 1", *server, "--json"]) in (0, 2)
    assert json.loads(capsys.readouterr().out)["findings"]
    assert main(["check", "named 2", *server]) == 2
    assert "no such session" in capsys.readouterr().err


@pytest.mark.thorough
@pytest.mark.parametrize(
    "address", ["127.0.0.1:8000", "ftp://x", "http://127.0.0.1:1", "http://[", "http://127.0.0.1:99999"]
)
def test_a_server_that_is_none_is_told_in_one_sentence(address: str, capsys: Printed) -> None:
    assert main(["check", "x", "--server", address]) == 2
    said = capsys.readouterr().err
    assert len(said.strip().splitlines()) == 1
    assert "fault of the program" not in said


def test_tokens_and_the_log_of_a_server_far_away(
    tmp_path: Path, capsys: Printed, monkeypatch: pytest.MonkeyPatch
) -> None:
    with guarded(tmp_path / "data") as (client, tokens):
        server = ["--server", site(client)]
        monkeypatch.setenv("SCANCELL_TOKEN", tokens["read"])
        assert main(["token", "list", *server]) == 2
        assert "role admin" in capsys.readouterr().err
        monkeypatch.setenv("SCANCELL_TOKEN", tokens["admin"])
        assert main(["token", "create", "--name", "robot 4", "--role", "capture", "--days", "2", *server]) == 0
        made = bearer(capsys.readouterr().out.strip())
        assert client.get("/me", headers=made).json()["name"] == "robot 4"
        assert main(["token", "list", *server, "--json"]) == 0
        [listed] = [t for t in json.loads(capsys.readouterr().out)["tokens"] if t["name"] == "robot 4"]
        assert main(["token", "revoke", listed["id"], *server]) == 0
        assert client.get("/sessions", headers=made).status_code == 401
        assert main(["audit", "--limit", "3", *server, "--json"]) == 0
        rows = json.loads(capsys.readouterr().out)["rows"]
        assert len(rows) == 3
        assert any(row["method"] == "DELETE" and row["path"].endswith(listed["id"]) for row in rows)


@pytest.mark.thorough
def test_an_archive_is_checked_and_solved_afresh_there_and_not_kept(
    client: httpx.Client, folder: Path, tmp_path: Path, capsys: Printed
) -> None:
    archive, server = str(tmp_path / "cell.zip"), ["--server", site(client)]
    assert main(["archive", "pack", str(folder), "--no-scene", "--out", archive]) == 0
    capsys.readouterr()
    before = client.get("/sessions").json()["items"]
    assert main(["archive", "verify", archive, *server, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["captures"] == 14
    assert main(["archive", "replay", archive, *server, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["equal"], [stage["stage"] for stage in found["stages"]]) == (True, ["tcp"])
    assert client.get("/sessions").json()["items"] == before
    Path(archive).write_bytes(Path(archive).read_bytes()[:5000])
    assert main(["archive", "verify", archive, *server]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


@pytest.mark.thorough
def test_a_token_comes_from_the_environment(
    tmp_path: Path, folder: Path, capsys: Printed, monkeypatch: pytest.MonkeyPatch
) -> None:
    with guarded(tmp_path / "data") as (client, tokens):
        command = ["run", str(folder), "--server", site(client), "--quiet"]
        assert main(command) == 2
        assert "SCANCELL_TOKEN" in capsys.readouterr().err
        monkeypatch.setenv("SCANCELL_TOKEN", tokens["capture"])
        assert main(command) == 0
