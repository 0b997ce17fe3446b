"""The robot's arm in the cell's dialog: by its name, from a URDF, and a file that is none refused in sight."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import expect

from tests.arm_cell import simulate_arm
from tests.core.test_urdf import UR5E
from tests.server.live_server import wait_for
from tests.web.browsing import Watch

pytestmark = pytest.mark.browser


def test_an_arm_is_given_by_its_urdf(
    open_page: Callable[..., Any], watch: Watch, address: str, tmp_path: Path
) -> None:
    watch.announce("status of 422")
    good, bad = tmp_path / "robot.urdf", tmp_path / "entities.urdf"
    good.write_text(UR5E)
    bad.write_text('<!DOCTYPE r [<!ENTITY a "b">]><robot>&a;</robot>')
    with httpx.Client(base_url=f"{address}/api/v1", trust_env=False) as client:
        cell = {"pose_convention": "ur", "sphere_diameter_mm": 40.0}
        session = client.post("/sessions", json={"name": "with an arm", "cell": cell}).json()["id"]
        page, _ = open_page(f"/sessions/{session}")
        page.get_by_role("button", name="Edit cell").click()
        page.locator("dialog summary", has_text=re.compile("^More$")).click()
        page.get_by_role("button", name="Choose the robot's arm").click()
        arm = page.get_by_label("Arm", exact=True)
        expect(arm.locator("option", has_text="ur10e")).to_have_count(1)
        with page.expect_file_chooser() as chooser:
            arm.select_option("urdf")
        chooser.value.set_files(bad)
        expect(page.locator("sc-toasts")).to_contain_text("entity declaration")
        expect(arm).to_have_value("")
        with page.expect_file_chooser() as chooser:
            arm.select_option("urdf")
        chooser.value.set_files(good)
        expect(arm.locator("option:checked")).to_have_text("robot.urdf: base → tool0: 6 joints")
        page.get_by_label("Errors of the arm that are found").select_option("apply")
        page.get_by_role("button", name="Save").click()
        expect(page.locator("dialog[open]")).to_have_count(0)
        stored = client.get(f"/sessions/{session}").json()["cell"]["robot"]
        assert [joint["name"] for joint in stored["arm"]["joints"]][:2] == ["pan", "lift"]
        assert stored["errors"] == "apply"
        page.get_by_role("button", name="Edit cell").click()
        page.locator("dialog summary", has_text=re.compile("^More$")).click()
        expect(page.get_by_label("Errors of the arm that are found")).to_have_value("apply")


def test_a_cell_of_whole_centres_needs_no_diameter(open_page: Callable[..., Any], address: str) -> None:
    with httpx.Client(base_url=f"{address}/api/v1", trust_env=False) as client:
        session = client.post("/sessions", json={"cell": {"pose_convention": "quaternion-xyzw"}}).json()["id"]
        record = {
            "id": "c1",
            "step": "tcp",
            "kind": "center",
            "center_mm": [1, 2, 150],
            "pose": [0, 0, 0, 0, 0, 0, 1],
        }
        client.post(
            f"/sessions/{session}/captures", files={"record": (None, json.dumps(record))}
        ).raise_for_status()
        page, _ = open_page(f"/sessions/{session}")
        page.get_by_role("button", name="Edit cell").click()
        expect(page.get_by_label("Scanner output")).to_have_value("center")
        page.get_by_role("button", name="Save").click()
        expect(page.locator("dialog[open]")).to_have_count(0)
        assert client.get(f"/sessions/{session}").json()["cell"]["scanner"]["kind"] == "center"


def test_what_was_found_of_the_arm_stands_on_the_page(open_page: Callable[..., Any], address: str) -> None:
    """Its errors one by one with their ±, what they did at poses left out, and what is to do."""
    record = simulate_arm("cobot", 3, 15, held=0).session.to_json()
    with httpx.Client(base_url=f"{address}/api/v1", trust_env=False, timeout=60) as client:
        session = client.post("/sessions", json={"name": "an arm", "cell": record["cell"]}).json()["id"]
        for capture in record["captures"]:
            told = {"record": (None, json.dumps(capture))}
            client.post(f"/sessions/{session}/captures", files=told).raise_for_status()
        wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"], timeout_s=120)
        page, _ = open_page(f"/sessions/{session}")
        page.get_by_role("button", name="Show result").click()
        table = page.locator("table", has_text="Zero of joint 3")
        page.locator("summary", has_text="The arm's own errors").click()
        expect(table.first).to_be_visible()
        expect(table.first).to_contain_text(re.compile(r"Zero of joint 3\s*[−0-9.]+\s*±\s*[0-9.]+\s*°"))
        page.locator("summary", has_text="Notes").first.click()
        said = "With the arm's own errors solved, other poses are predicted to"
        expect(page.get_by_text(said).locator("visible=true").first).to_be_visible()
