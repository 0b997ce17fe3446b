"""Wrong clicks on the way: twice instead of once, back with a dialog open, back with files that wait."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import expect

from tests.server.live_server import make_session, simulated_session

pytestmark = pytest.mark.browser


@pytest.fixture
def api(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
        yield client


def count(api: httpx.Client) -> int:
    return len(api.get("/sessions?limit=1000").json()["items"])


@pytest.mark.thorough
def test_a_double_click_makes_one_session(open_page: Callable[..., Any], api: httpx.Client) -> None:
    before = count(api)
    page, _ = open_page()
    page.get_by_role("button", name="With a turntable").dblclick()
    page.wait_for_url("**/sessions/*")
    page.go_back()
    page.get_by_role("button", name="New session").click()
    page.get_by_label("Sphere diameter").first.fill("40")
    page.locator("#new-convention").select_option("fanuc")
    page.get_by_role("button", name="Create session").dblclick()
    page.wait_for_url("**/sessions/*")
    expect(page.locator("sc-guide h1")).not_to_be_empty()
    assert count(api) == before + 2


def test_a_double_click_changes_a_capture_once(open_page: Callable[..., Any], api: httpx.Client) -> None:
    page, watched = open_page(f"/sessions/{simulated_session(api, captures=3)}")
    page.get_by_role("button", name="Delete p01").dblclick()
    expect(page.locator("table.captures tbody tr")).to_have_count(2)
    page.wait_for_timeout(500)
    expect(page.locator(".toast")).to_have_text([re.compile("Capture p01 deleted")])
    page.get_by_role("checkbox", name="Use p02").dblclick()
    expect(page.locator("table.captures tbody tr.out")).to_have_count(1)
    page.get_by_role("button", name="Take p03 again").dblclick()
    expect(page.locator("table.captures tbody tr")).to_have_count(3)
    page.wait_for_timeout(500)
    expect(page.locator(".toast.bad")).to_have_count(0)
    assert watched.complaints == []


def test_a_dialog_goes_with_its_page(open_page: Callable[..., Any], api: httpx.Client) -> None:
    page, _ = open_page()
    page.evaluate(
        "(path) => { history.pushState(null, '', path); dispatchEvent(new PopStateEvent('popstate')); }",
        f"/sessions/{make_session(api, name='left')}",
    )
    page.get_by_role("button", name="Edit cell").click()
    expect(page.get_by_role("dialog")).to_be_visible()
    page.go_back()
    expect(page.locator("sc-start")).to_be_visible()
    expect(page.get_by_role("dialog")).to_have_count(0)


def test_files_that_wait_are_there_again(open_page: Callable[..., Any], api: httpx.Client, tmp_path: Path) -> None:
    path = tmp_path / "p01.csv"
    path.write_text("".join(f"{x / 10},{0.01 * x * x}\n" for x in range(-100, 100)), encoding="utf-8")
    page, _ = open_page()
    page.evaluate(
        "(path) => { history.pushState(null, '', path); dispatchEvent(new PopStateEvent('popstate')); }",
        f"/sessions/{make_session(api, name='with files')}",
    )
    page.get_by_label("Choose measurement files").set_input_files(path)
    expect(page.locator(".file-list")).to_contain_text("p01.csv")
    page.go_back()
    expect(page.locator("sc-start")).to_be_visible()
    page.go_forward()
    expect(page.locator(".file-list")).to_contain_text("p01.csv")
    asked: list[str] = []

    def hear(dialog: Any) -> None:
        asked.append(dialog.type)
        dialog.dismiss()

    page.on("dialog", hear)
    page.evaluate("location.reload()")
    page.wait_for_timeout(500)
    assert asked == ["beforeunload"]
    expect(page.locator(".file-list")).to_contain_text("p01.csv")
