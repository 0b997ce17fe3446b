"""Machines' own files over REST: looked at before they are used, a tool put into a backup and read back."""

import io
import json
import zipfile
from typing import Any

import httpx
import numpy as np
import pytest

from calib_core.robots import parse_pose
from calib_core.robots.backup import read_controller_files
from tests.core.robot_dialects import CONFIG, DAT
from tests.server.live_server import assert_problem, simulated_session, upload, wait_for
from tests.server.test_captures import arc_csv

FILES = [("files", ("cell/style1.dat", DAT.encode())), ("files", ("cell/$config.dat", CONFIG.encode()))]


@pytest.fixture(scope="module")
def solved(shared_client: httpx.Client) -> str:
    client = shared_client
    session = simulated_session(client, captures=12)
    wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"])
    return session


def packed(**files: str) -> bytes:
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(name.replace("__", "."), text)
    return target.getvalue()


def test_a_controllers_files(client: httpx.Client) -> None:
    found = client.post("/controller-files", files=FILES).json()
    assert (found["brand"], sorted(found["files"])) == ("kuka", ["cell/$config.dat", "cell/style1.dat"])
    first = next(pose for pose in found["poses"] if pose["name"] == "XP1")
    assert first["pose"] == [214.5, 193.6, 1005.8, 6.6, -23.4, 9.8]
    assert first["matrix"] == parse_pose("kuka", first["pose"]).to_rows()
    assert first["external"]["E1"] == 45
    assert [tool["number"] for tool in found["tools"]] == [1, 2]
    assert any("stands still" in row["reason"] for row in found["skipped"])


def test_tables_are_told_what_their_columns_are(client: httpx.Client) -> None:
    table = {"files": ("poses.csv", b"1000,0,500,0,0,0\n")}
    assert_problem(client.post("/controller-files", files=table), 422, "table")
    told = {"told": json.dumps({"columns": "x,y,z,a,b,c", "convention": "kuka"})}
    found = client.post("/controller-files", files=table, data=told).json()
    assert found["poses"][0]["pose"] == [1000, 0, 500, 0, 0, 0]
    assert_problem(client.post("/controller-files", files=table, data={"told": '{"units": "mm"}'}), 422, "units")
    assert_problem(client.post("/controller-files", files=table, data={"told": "[1]"}), 422, "JSON object")


def test_a_scanners_file_is_shown_before_it_is_used(client: httpx.Client) -> None:
    metres = b"x,z\n" + b"".join(b"%.6f,%.6f\n" % (x / 1e5, 0.00015) for x in range(-20, 20))
    file = {"file": ("p01.csv", metres)}
    doubtful = client.post("/readings", files=file, data={"kind": "profile"}).json()
    assert doubtful["sure"] == "doubtful"
    assert "look like metres" in doubtful["doubts"][0]
    assert doubtful["columns"] == {"x": "x", "z": "z"}
    told = {"kind": "profile", "settings": '{"unit": "m"}'}
    certain = client.post("/readings", files=file, data=told).json()
    assert (certain["sure"], certain["unit"], certain["unit_from"]) == ("stated", "m", "settings")
    assert certain["high_mm"] == pytest.approx([0.19, 0.15])
    assert "columns" in certain["settings"]["properties"]
    assert_problem(client.post("/readings", files={"file": ("a.csv", b"a,b\n1,2\n")}), 422, "columns")


def test_a_tool_is_put_into_a_copy_of_the_backup_and_read_back(client: httpx.Client, solved: str) -> None:
    backup = [("backup", (name, data)) for _, (name, data) in FILES]
    session = client.get(f"/sessions/{solved}")
    answer = client.post(f"/sessions/{solved}/exports/kuka", files=backup, data={"settings": '{"tool": 1}'})
    now = client.get(f"/sessions/{solved}")  # nothing is stored, so a reader may
    assert (now.headers["etag"], now.json()) == (session.headers["etag"], session.json())
    assert answer.headers["content-disposition"] == "attachment; filename*=UTF-8''%24config.dat"
    before, after = CONFIG.splitlines(), answer.content.decode().splitlines()
    assert [i for i, pair in enumerate(zip(before, after, strict=True)) if pair[0] != pair[1]] == [2]
    expected = client.get(f"/sessions/{solved}/answer").json()["tool0_from_laser"]["matrix"]
    tool = next(t for t in read_controller_files({"c.dat": answer.content}, "kuka").tools if t.number == 1)
    np.testing.assert_allclose(parse_pose("kuka", tool.pose).matrix, expected, atol=1e-8)

    same = client.post(
        f"/sessions/{solved}/read-back", files={"files": ("c.dat", answer.content)}, data={"tool": "1"}
    ).json()
    assert same == same | {"equal": True}
    x, y, z, a, b, c = tool.pose
    swapped: Any = {"numbers": (None, f"{x} {y} {z} {a} {c} {b}"), "convention": (None, "kuka")}
    other = client.post(f"/sessions/{solved}/read-back", files=swapped).json()
    assert (other["equal"], "swapped" in other["words"]) == (False, True)


def test_an_export_takes_its_settings(client: httpx.Client, solved: str) -> None:
    place = f"/sessions/{solved}/exports/kuka-check-move"
    program = client.get(place, params={"settings": '{"tool": 3, "approach_mm": 200}'})
    assert "$TOOL=TOOL_DATA[3]" in program.text
    assert "$TOOL=TOOL_DATA[1]" in client.get(place).text
    assert_problem(client.get(place, params={"settings": '{"approach_mm": 5}'}), 422, "approach_mm")
    assert_problem(client.get(place, params={"settings": "[]"}), 422, "JSON object")


def test_a_zip_comes_back_with_one_file_changed(client: httpx.Client, solved: str) -> None:
    data = packed(**{"R1/config__dat": CONFIG, "R1/style1__dat": DAT, "am__ini": "[Archive]\n"})
    settings = {"settings": '{"tool": 1}'}
    answer = client.post(f"/sessions/{solved}/exports/kuka", files={"backup": ("a.zip", data)}, data=settings)
    with zipfile.ZipFile(io.BytesIO(answer.content)) as new, zipfile.ZipFile(io.BytesIO(data)) as old:
        assert new.namelist() == old.namelist()
        assert [n for n in new.namelist() if new.read(n) != old.read(n)] == ["R1/config.dat"]


@pytest.mark.parametrize(
    ("name", "settings", "words"),
    [
        ("kuka", '{"tool": 9}', "a file that defines the tool"),
        ("kuka", '{"tool": 2}', "#TCP"),
        ("json", "{}", "export that can change a backup"),
        ("nothing", "{}", "nothing"),
    ],
)
def test_what_cannot_be_written_is_refused(
    client: httpx.Client, solved: str, name: str, settings: str, words: str
) -> None:
    files: Any = {"backup": ("$config.dat", CONFIG.encode())}
    answer = client.post(f"/sessions/{solved}/exports/{name}", files=files, data={"settings": settings})
    assert answer.status_code in (404, 422)
    assert words in answer.json()["detail"] or words == "a file that defines the tool"


def test_brands_are_listed(client: httpx.Client) -> None:
    listed = {brand["name"]: brand for brand in client.get("/brands").json()["items"]}
    assert {"kuka", "abb", "fanuc", "ur", "yaskawa", "ros", "table"} <= listed.keys()
    assert ".mcap" in listed["ros"]["endings"]


def test_files_in_captures_keep_their_settings(client: httpx.Client, solved: str) -> None:
    record = {"id": "m1", "step": "tcp", "kind": "profile", "format_settings": {"unit": "m"}, "format": "table",
              "pose": [0, 0, 0, 1, 0, 0, 0]}  # fmt: skip
    metres = b"x,z\n" + b"".join(
        b"%.7f,%.7f\n" % (x / 10e3, (150 - (225 - x * x / 100) ** 0.5) / 1e3) for x in range(-120, 121)
    )
    stored = upload(client, solved, record, metres)
    assert stored.json()["measured"]["points"] == 241
    assert arc_csv()
