"""Ways through the page, by keyboard alone and by mouse alone: no dead end, no refusal, no silent wait."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import Locator, expect

from server.simulated_cell.devices import SimulatedDevices
from tests.server.live_rig import until
from tests.server.live_server import simulated_session, wait_for
from tests.web.browsing import Watch
from tests.web.person import Means, Person
from tests.web.test_backup_walk import MADE, RECORD, backup  # noqa: F401 — the fixture
from tests.web.test_live_panel import connected, good

pytestmark = pytest.mark.browser
MOST = 120


@pytest.fixture(params=["keyboard", "mouse"])
def begin(request: pytest.FixtureRequest, open_page: Callable[..., Any]) -> Iterator[Callable[[str], Person]]:
    """Open a page before a person, whose way is to have been clear at the end."""
    means: Means = request.param
    people: list[Person] = []

    def opened(path: str = "/") -> Person:
        page, _ = open_page("about:blank", width=1280, height=720)
        people.append(Person(page, means))
        page.goto(path)
        return people[0]

    yield opened
    people[0].look("end")
    people[0].require_a_clear_way()


@pytest.fixture
def api(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
        yield client


def follow(person: Person, step: str) -> None:
    """Do what the page offers first until a step is done."""
    done = person.page.locator(f"sc-rail [data-step={step}]:is(.status-done, .status-usable)")
    for _ in range(MOST):
        if done.count():
            return
        person.go_on()
    raise AssertionError(f"{step} is not done after {person.done}")


@pytest.mark.thorough
def test_an_own_folder(begin: Callable[..., Person], backup: Path) -> None:  # noqa: F811
    person = begin()
    person.choose_files("Open a session folder", backup)
    person.fill("Sphere diameter", str(RECORD["cell"]["sphere_diameter_mm"]))
    person.named("Create session")
    person.named(f"Add {len(MADE.session.captures)} captures")
    expect(person.page.locator("sc-guide h1")).to_contain_text("Solve")  # it follows the captures as they come
    follow(person, "tcp")


@pytest.mark.thorough
def test_an_archive(begin: Callable[..., Person], api: httpx.Client, tmp_path: Path) -> None:
    session = simulated_session(api, captures=12)
    wait_for(api, api.post(f"/sessions/{session}/solve/tcp").json()["id"])
    path = tmp_path / "cell.zip"
    path.write_bytes(api.get(f"/sessions/{session}/archive?scene=false").content)
    person = begin()
    person.choose_files("Import an archive", path)
    expect(person.page.locator("sc-rail [data-step=tcp].status-done")).to_be_visible()
    assert person.go_on() == "Continue with Verify"
    person.press(person.page.locator("sc-rail [data-step=tcp]"))
    person.press(person.page.get_by_role("tab", name="Result"))
    expect(person.page.locator(".answer-card")).to_contain_text("±")
    with person.page.context.expect_page() as report:
        person.press(person.page.get_by_role("link", name="Report"))
    expect(report.value.locator("body")).to_contain_text("simulated tcp, seed 7")


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("begins", "steps"),
    [
        ("With a turntable", ("tcp", "turntable", "verify", "merge")),
        ("With raw camera frames", ("camera", "laser-plane", "tcp")),
    ],
)
def test_a_simulated_cell_to_its_end(begin: Callable[..., Person], begins: str, steps: tuple[str, ...]) -> None:
    person = begin()
    person.named(begins)
    expect(person.page.locator("sc-guide h1")).not_to_be_empty(timeout=120_000)  # the cell is simulated first
    for step in steps:
        follow(person, step)


def captured(person: Person, rows: Locator, count: int) -> bool:
    """Capture where the cell stands; where it is refused, as while a busy machine's poses come late, say no."""
    with person.page.expect_response("**/live/capture") as told:
        person.named("Capture now")
    if told.value.status == 201:
        expect(rows).to_have_count(count)
    return told.value.status == 201


@pytest.mark.thorough
def test_a_live_cell(begin: Callable[..., Person], api: httpx.Client, watch: Watch) -> None:
    watch.allow("status of 409.*/live/capture")
    cell = SimulatedDevices("turntable", 3, rate_hz=16.0, travel_s=0.25, scanner_clock_s=0.037)
    try:
        person = begin(f"/sessions/{connected(api, cell, 'a live cell')}")
        person.named("Devices")
        expect(person.page.locator(".live-devices li[data-status=live]")).to_have_count(3)
        rows = person.page.locator("table.captures tbody tr")
        for count, number in enumerate([k for k in good(cell) if cell.cell.shots[k].table is None], start=1):
            cell.go(number)
            until(lambda: not cell.cell.at(time.monotonic()).moving)
            expect(person.page.locator("sc-live-sign")).to_have_attribute("data-state", "ready")
            until(lambda count=count: captured(person, rows, count))
            expect(person.page.locator("sc-guide h1")).not_to_be_empty()
            if person.primary.filter(has_text="Solve").count():
                break
        follow(person, "tcp")
    finally:
        cell.stop()
