"""The generated client: as current as the API, and good for a calibration from end to end."""

import importlib.util
from pathlib import Path
from types import ModuleType

import httpx
import pytest

from calib_core.simulation import simulate
from server.commands.schema.records import schema_text
from tests.server.live_server import wait_for

CLIENT = Path(__file__).resolve().parents[2] / "docs" / "client" / "scancell_client.py"


@pytest.fixture(scope="module")
def generated() -> ModuleType:
    spec = importlib.util.spec_from_file_location("scancell_client", CLIENT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_client_is_current() -> None:
    to_do = "scancell schema python-client > docs/client/scancell_client.py"
    assert CLIENT.read_text(encoding="utf-8") == schema_text("python-client"), to_do


def test_the_client_calibrates(client: httpx.Client, generated: ModuleType) -> None:
    cell = simulate("tcp", 7)
    with generated.Scancell(str(client.base_url).removesuffix("/api/v1/"), trust_env=False) as api:
        record = cell.session.to_json()
        captures = record.pop("captures")
        session = api.sessions_create(record)["id"]
        for capture in captures:
            files = {name: cell.files[name] for name in capture["files"]}
            assert api.captures_add(session, capture, files)["measured"]["verdict"] != "fail"
        name = captures[0]["files"][0]
        assert api.captures_get_file(session, captures[0]["id"], name) == cell.files[name]
        assert len(api.captures_list_all(session, limit=5)["items"]) == 5
        job = api.solves_solve(session, "tcp")
        assert wait_for(client, job["id"])["status"] == "done"
        assert api.solves_get_result(session, "tcp")["verdict"] == "pass"
        archive = api.archives_get_archive(session, scene=False)
        assert api.archives_verify_archive(archive)["captures"] == len(captures)
        assert api.captures_change(session, "p01", {"excluded": True}, if_match="*")["excluded"] is True
        with pytest.raises(generated.ProblemError, match="none") as refused:
            api.sessions_get("none")
        assert refused.value.status == 404
        assert api.sessions_delete(session) is None
