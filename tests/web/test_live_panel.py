"""The simulated cell calibrated in the page through live sources, and what the page says of devices that go."""

import re
import time
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import numpy as np
import pytest
from playwright.sync_api import Page, expect
from scipy.stats import chi2

from calib_core.arms.kinematics import arm_of, flange_of_joints
from calib_core.formats.points import parse_cloud
from calib_core.frames import RigidTransform
from calib_core.robots import parse_pose
from server.simulated_cell.devices import SimulatedDevices
from tests.server.live_rig import until
from tests.server.live_server import make_session, wait_for
from tests.web.browsing import Watch

pytestmark = pytest.mark.browser
SEED = 3
REFUSED = "status of 4(09|22).*/live/(sweep|clock-offset)"
"""A sweep on a busy machine, on which poses come late: it is recorded again."""
DRAWN_UNDER_A_PRESS = """async (panel) => {
  const drawn = [], rest = (ms) => new Promise((go) => setTimeout(go, ms));
  const options = { childList: true, characterData: true, subtree: true };
  new MutationObserver(() => drawn.push(performance.now())).observe(panel.querySelector(".live-rate"), options);
  window.dispatchEvent(new PointerEvent("pointerdown"));
  const from = performance.now();
  await rest(300);
  const to = Math.min(performance.now(), from + 390);
  window.dispatchEvent(new PointerEvent("pointerup"));
  while (!drawn.some((at) => at >= to)) await rest(50);
  return drawn.filter((at) => at < to).length;
}"""
"""Previews drawn while a button is held down: a first one would move it away below the pointer."""


@pytest.fixture
def cell() -> Iterator[SimulatedDevices]:
    made = SimulatedDevices("turntable", SEED, rate_hz=16.0, travel_s=0.25, scanner_clock_s=0.037)
    yield made
    made.stop()


@pytest.fixture
def api(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
        yield client


def connected(api: httpx.Client, cell: SimulatedDevices, name: str) -> str:
    record = {**cell.simulated.session.to_json()["cell"], "merge": {"mesh": "none"}}  # nobody looks at a mesh
    session = make_session(api, name=name, cell=record)
    for device, body in cell.sources().items():
        answer = api.put(f"/sessions/{session}/devices/{device}", json=dict(body))
        assert answer.status_code == 200, answer.text
    return session


def captures(api: httpx.Client, session: str) -> list[Any]:
    return api.get(f"/sessions/{session}/captures").json()["items"]


def good(cell: SimulatedDevices) -> list[int]:
    """Where the stripe lies well on the sphere: other captures are refused."""
    radius = cell.cell.world.sphere_radius_mm
    offsets = [abs(shot.sphere_center_in_laser_mm[1]) / radius for shot in cell.cell.shots]
    return [k for k, offset in enumerate(offsets) if 0.36 < offset < 0.78]


def open_panel(page: Page) -> None:
    page.get_by_role("button", name="Devices").click()
    expect(page.locator(".live-devices li[data-status=live]")).to_have_count(3)


def unlikely(found: Any, truth: Any, covariance: Any, frames: tuple[str, str]) -> float:
    """Return in which share of right answers the truth would be as far; the turn of a table's frame is chosen."""
    off = RigidTransform(np.array(found), *frames).difference(RigidTransform(np.array(truth), *frames))
    inverse = np.linalg.pinv(np.array(covariance), rcond=1e-9, hermitian=True)
    return float(chi2.sf(off @ inverse @ off, np.linalg.matrix_rank(inverse, hermitian=True)))


def scan(page: Page, api: httpx.Client, session: str, cell: SimulatedDevices, numbers: list[int]) -> None:
    """Move across the sphere at some table angles, and record a sweep at each, as a person does in the page."""
    page.locator("#live-step").select_option("scan")
    until(lambda: api.get(f"/sessions/{session}/devices").json()["capture"]["step"] == "scan")
    page.locator("#live-seconds").fill("1.4")
    cell.cell.shake(12.0, 2.4, across=True)
    for count, number in enumerate(numbers, start=1):
        cell.go(number)
        until(lambda: not cell.cell.at(time.monotonic()).turning)
        time.sleep(5.2 if count == 1 else 0.5)  # the clocks are found in a move of five seconds
        until(lambda count=count: recorded(page, api, session, count), page.locator(".toasts").inner_text)


def recorded(page: Page, api: httpx.Client, session: str, count: int) -> bool:
    """Record a sweep; where it is refused, as for a late pose on a busy machine, measure the clocks again."""
    sweep = page.get_by_role("button", name="Record a sweep")
    before = len(captures(api, session))
    if count == 1:
        measure_clocks(page)
    with page.expect_response("**/live/sweep") as told:
        sweep.click()
    expect(sweep).not_to_have_attribute("aria-disabled", "true")
    if told.value.status != 201:
        measure_clocks(page)
    return len(captures(api, session)) > before


def measure_clocks(page: Page) -> None:
    measure = page.get_by_role("button", name="Measure clocks")
    expect(measure).not_to_have_attribute("aria-disabled", "true")  # as where a busy machine's robot tells late
    with page.expect_response("**/live/clock-offset"):
        measure.click()


def merged_points(api: httpx.Client, session: str, result: Any) -> Any:
    name = result["cloud"].rpartition("/")[2]
    return parse_cloud(api.get(f"/sessions/{session}/clouds/{name}").content, name)


@pytest.mark.thorough
def test_tool_table_and_merge_are_calibrated_in_the_page(
    open_page: Callable[..., Any], api: httpx.Client, cell: SimulatedDevices, watch: Watch
) -> None:
    watch.allow(REFUSED)
    session = connected(api, cell, "live calibration")
    page, watched = open_page(f"/sessions/{session}", width=1500, height=1000)
    open_panel(page)
    page.wait_for_function("() => Number(document.querySelector('sc-live-panel').dataset.rate) >= 2")
    expect(page.locator(".live-panel canvas")).to_be_visible()
    numbers = good(cell)
    tcp = [k for k in numbers if cell.cell.shots[k].table is None][:9]
    table = [k for k in numbers if cell.cell.shots[k].table is not None][::2]
    expected: list[Any] = []
    page.get_by_label("Capture automatically at standstill").check()
    for number in (*tcp, *table):
        shot = cell.cell.shots[number]
        if shot.table:
            wanted = {"automatic": True, "step": "turntable", "mount": shot.table.reported_mount}
            page.locator("#live-step").select_option("turntable")
            page.locator("#live-mount").fill(shot.table.reported_mount or "")
            page.locator("#live-mount").blur()
            until(lambda wanted=wanted: api.get(f"/sessions/{session}/devices").json()["capture"] == wanted)
        cell.go(number)
        expected.append(shot)
        until(lambda: len(captures(api, session)) >= len(expected), page.locator("sc-live-sign").inner_text)
    expect(page.locator("sc-live-sign")).to_have_attribute("data-state", re.compile("good|wait"))
    page.get_by_label("Capture automatically at standstill").uncheck()
    turned = [k for k in numbers if cell.cell.shots[k].table is not None]
    low = [k for k in turned if cell.cell.shots[k].table.reported_mount == "low"]
    scan(page, api, session, cell, low[:3])
    found = [capture for capture in captures(api, session) if capture["step"] != "scan"]
    assert len(found) == len(expected)
    for capture, shot in zip(found, expected, strict=True):
        told = RigidTransform(shot.reported, "base", "tool0")
        assert np.abs(told.difference(parse_pose("abb", capture["pose"]))).max() < 1e-5
        by_joints = flange_of_joints(arm_of("ur20"), capture["joints_deg"])
        assert np.abs(told.difference(by_joints)).max() < 1e-5
        assert capture["moving"] is False
        assert "stood still" in capture["source"]
        seen = np.array(capture["measured"]["center_mm"])
        assert np.abs(seen - shot.sphere_center_in_laser_mm[[0, 2]]).max() < 0.1
        if shot.table:
            assert capture["table_deg"] == pytest.approx(shot.table.reported_angle, abs=6e-4)
            assert capture["mount"] == shot.table.reported_mount
    assert wait_for(api, api.post(f"/sessions/{session}/solve/all").json()["id"], 120)["status"] == "done"
    results, truth = api.get(f"/sessions/{session}/results").json(), cell.simulated.truth
    tool = results["tcp"]
    frames = ("tool0", "laser")
    assert unlikely(tool["tool0_from_laser"], truth["tool0_from_laser"], tool["covariance"], frames) > 0.001
    table, frames = results["turntable"], ("base", "turntable")
    assert (
        unlikely(table["base_from_turntable"], truth["base_from_turntable"], table["covariance"], frames) > 0.001
    )
    merged = results["merge"]
    assert [row["capture"] for row in merged["residuals"]] == ["s01", "s02", "s03"]
    points, center = merged_points(api, session, merged), truth["mounts_in_turntable_mm"]["low"]
    off = np.linalg.norm(points - center, axis=1) - truth["sphere_diameter_mm"] / 2
    assert np.sqrt(np.mean(off**2)) < 2.5 * merged["surface_sigma_mm"]  # χ² of three, 99.9 %
    assert merged["surface_sigma_mm"] < 0.5
    assert merged["overlap_rms_mm"] < 2.0 * merged["expected_overlap_rms_mm"]
    expect(page.locator("sc-rail")).to_contain_text("done")
    assert [text for text in watched.complaints if not re.search("status of 4(09|22)", text)] == []


def test_a_device_that_goes_is_told_and_comes_back(
    open_page: Callable[..., Any], api: httpx.Client, cell: SimulatedDevices
) -> None:
    session = connected(api, cell, "live losses")
    page, watched = open_page(f"/sessions/{session}", width=1500, height=1000)
    open_panel(page)
    cell.robot.is_out.set()
    cell.robot.cut()
    sign = page.locator("sc-live-sign")
    expect(sign).to_contain_text("robot lost")
    expect(sign).to_have_attribute("data-state", "bad")
    expect(page.locator(".live-devices li[data-status=lost]")).to_contain_text("robot")
    cell.robot.is_out.clear()
    expect(page.locator(".live-devices li[data-status=live]")).to_have_count(3)
    expect(sign).to_have_attribute("data-state", re.compile("ready|move"))
    cell.go(good(cell)[0])
    until(lambda: not cell.cell.at(time.monotonic()).moving)
    page.get_by_role("button", name="Capture now").click()
    expect(page.locator(".captures tbody tr")).to_have_count(1)
    page.get_by_role("button", name="Remove table").click()
    expect(page.locator(".live-devices li")).to_have_count(2)
    page.get_by_role("button", name="Add device").click()
    page.get_by_label("Source").select_option("modbus")
    page.locator("#device-host").fill("127.0.0.1")
    page.locator("#device-port").fill(str(cell.modbus.port if cell.modbus else 0))
    page.locator("#device-address").fill("100")
    page.locator("sc-devices form").get_by_role("button", name="Connect").click()
    expect(page.locator(".live-devices li[data-status=live]")).to_have_count(3)
    assert watched.complaints == []


def test_the_table_is_armed_turned_and_disarmed_in_the_page(
    open_page: Callable[..., Any], api: httpx.Client, cell: SimulatedDevices
) -> None:
    session = connected(api, cell, "live table")
    page, watched = open_page(f"/sessions/{session}", width=1500, height=1000)
    open_panel(page)
    table = page.locator("sc-live-table")
    expect(table).to_contain_text("turned by hand")
    expect(page.locator(".live-rate")).to_contain_text("ms")
    assert page.locator("sc-live-panel").evaluate(DRAWN_UNDER_A_PRESS) == 0
    table.get_by_role("button", name="Arm the table").click()
    expect(table).to_contain_text("no emergency stop")
    given = {"low-deg": -5, "high-deg": 355, "host": "127.0.0.1", "port": cell.modbus.port if cell.modbus else 0}
    for name, value in {**given, "target": 200, "start": 20, "stop": 21}.items():
        page.locator(f"#mover-{name}").fill(str(value))
    table.locator("form").get_by_role("button", name="Arm the table").click()
    expect(table).to_contain_text("Armed from")
    angle = max(shot.table.reported_angle for shot in cell.cell.shots if shot.table)
    target = page.get_by_label("Turn to, in degrees")
    with page.expect_request("**/table-mover/go") as asked:  # the first that is sent is of a number
        table.get_by_role("button", name="Turn", exact=True).click()
        assert target.evaluate("field => field.validity.customError")
        target.fill(f"{angle:.3f}")
        table.get_by_role("button", name="Turn", exact=True).click()
    assert asked.value.post_data_json == {"table_deg": pytest.approx(angle, abs=1e-3)}
    until(lambda: abs(cell.cell.at(time.monotonic()).table_deg - angle) < 0.01)
    expect(page.locator("sc-live-panel .figures")).to_contain_text(f"{angle:.2f}°")
    table.get_by_role("button", name="STOP").click()
    table.get_by_role("button", name="Disarm").click()
    expect(table).to_contain_text("turned by hand")
    assert api.get(f"/sessions/{session}/table-mover").json()["armed"] is False
    assert watched.complaints == []
