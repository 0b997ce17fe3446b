"""What speaks against an answer is told by page, REST and command line alike, each before anything is released."""

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import expect

from tests.server.access import site_of
from tests.server.wrong_releases import World, command, world
from tests.verified import shifted, verified_session
from tests.web.browsing import SharedProfile
from tests.web.test_release import log_in

pytestmark = pytest.mark.browser

TEXTS = json.loads((Path(__file__).parents[2] / "web" / "texts" / "release.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    with world(tmp_path_factory.mktemp("channels")) as made:
        yield made


def stale(here: World) -> str:
    path = here.session("stale-page", verified_session(8), stage="tcp")
    here.client.patch(f"{path}/captures/p03", json={"excluded": True}).raise_for_status()
    return path


def failed(here: World) -> str:
    made = verified_session(9)
    captures = [
        shifted(made.session, c, [60.0 * (k % 3), 0, 0], "tcp") for k, c in enumerate(made.session.captures)
    ]
    wrong = replace(made, session=made.session.model_copy(update={"captures": captures}))
    return here.session("wrong-page", wrong, stage="tcp")


def undecided(here: World) -> str:
    here.client.put("/cells/few-page/policy", json={"needs": ["verify"]}).raise_for_status()
    return here.session("few-page", verified_session(11, of_sphere=2, limits={"tool_mm": 2.0}))


def overdue(here: World) -> str:
    here.client.put("/cells/late-page/policy", json={"interval_days": 1e-7}).raise_for_status()
    return here.session("late-page", verified_session(16), stage="tcp")


def other_scanner(here: World) -> str:
    for serial in ("S-1", "S-2"):
        equipment = {"equipment": [{"kind": "scanner", "serial": serial}]}
        path = here.session("other-page", verified_session(15), equipment, "tcp")
        if serial == "S-1":
            here.release(path).raise_for_status()
    return path


def bumped(here: World) -> str:
    made = verified_session(14)
    here.release(here.session("bumped-page", made, stage="tcp")).raise_for_status()
    captures = [shifted(made.session, c, [1.0, 0, 0], "tcp") for c in made.session.captures]
    moved = replace(made, session=made.session.model_copy(update={"captures": captures}))
    return here.session("bumped-page", moved, stage="tcp")


WAYS: dict[str, Callable[[World], str]] = {
    "verify-fail": lambda here: here.failed,
    "stale": stale,
    "fail": failed,
    "verify-undecided": undecided,
    "overdue": overdue,
    "equipment-changed": other_scanner,
    "drift": bumped,
}
OF_THE_SESSION = ("verify-fail", "stale", "fail")
"""What an archive by itself knows; the rest is its cell's, of which the command line releases nothing."""


@pytest.mark.parametrize("fault", WAYS)
def test_page_rest_and_command_line_tell_it(
    fault: str, here: World, profile: SharedProfile, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = WAYS[fault](here)
    refused = here.release(path)
    assert refused.status_code == 409
    assert fault in refused.json()["detail"]
    if fault in OF_THE_SESSION:
        packed = tmp_path / "packed.zip"
        packed.write_bytes(here.client.get(f"{path}/archive", params={"scene": False}).raise_for_status().content)
        for words in (["answer", str(packed), "--json"], ["export", str(packed), "--format", "kuka"]):
            status, said = command(*words)
            assert status == 1, said
        status, said = command("answer", str(packed), "--json")
        assert fault in json.loads(said)["faults"]
    page = profile.open(reduced_motion="reduce")
    log_in(page, here.client, here.tokens["release"], f"{path}%23tcp.result")
    assert site_of(here.client) in page.url
    approval = page.get_by_role("region", name="Approval")
    told = TEXTS[f"release.fault.{fault}"]
    expect(approval).to_contain_text(told)
    page.get_by_role("button", name="Approve all the same").press("Enter")
    expect(page.get_by_role("dialog")).to_contain_text(told)
    page.get_by_role("button", name="Cancel").click()
