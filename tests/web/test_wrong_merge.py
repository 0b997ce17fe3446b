"""A merge whose poses, angles or units are wrong, in the page: named first, and one click repairs it."""

import json
import re
from collections.abc import Callable
from copy import deepcopy
from typing import Any

import httpx
import pytest
from playwright.sync_api import expect

from tests.core.test_merge_mistakes import (
    Mistake,
    astray,
    given,
    longer_steps,
    one_in_metres,
    reverse,
    swap,
)
from tests.server.live_server import wait_for

pytestmark = pytest.mark.browser


def stored(api: httpx.Client, mistake: Mistake, table: bool) -> str:
    """Store a session with a mistake; return its id."""
    record, files = deepcopy(given(table))
    mistake(record, files)
    session = api.post("/sessions", json={"name": record["name"], "cell": record["cell"]}).json()["id"]
    for capture in record["captures"]:
        (name,) = capture["files"]
        told = json.dumps({key: value for key, value in capture.items() if key != "files"})
        parts = {"record": (None, told), "files": (name.rpartition("/")[2], files[name])}
        api.post(f"/sessions/{session}/captures", files=parts).raise_for_status()
    return session


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("mistake", "table", "words", "deed"),
    [
        (reverse, True, "turned the other way round", "Reverse the direction"),
        (longer_steps, True, "multiplied by 0.95", "Convert the angles"),
        (swap, True, "of the other", "Exchange the poses"),
        (one_in_metres, True, "looks like metres", "Convert the files’ unit"),
        (astray, False, "is not where its pose puts it", "Leave out the scan"),
    ],
)
def test_a_click_repairs_a_merge(
    mistake: Mistake, table: bool, words: str, deed: str, open_page: Callable[..., Any], address: str
) -> None:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as api:
        session = stored(api, mistake, table)
        assert wait_for(api, api.post(f"/sessions/{session}/solve/merge").json()["id"])["status"] == "done"
        page, _ = open_page(f"/sessions/{session}#merge", width=1280, height=1000)
        page.set_default_timeout(120_000)
        page.get_by_role("tab", name="Result").click()
        answer = page.locator(".answer-card")
        expect(answer).to_have_class(re.compile("answer-fail"))
        expect(answer).to_contain_text(words)
        with page.expect_request(lambda request: request.url.endswith("/solve/merge")):
            page.get_by_role("button", name=deed).first.click()
        expect(answer).to_have_class(re.compile("answer-pass"), timeout=120_000)
        assert api.get(f"/sessions/{session}/results/merge").json()["verdict"] == "pass"
