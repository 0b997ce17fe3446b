"""Where a session goes with its dates: folder, archives, another server, a restored store, another time zone."""

import json
import os
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx

import calib_core as cc
from calib_core.archive.seals import signed_result
from server.cli import main
from server.settings import Settings
from server.store.backup import back_up
from tests.core.archives import entries_of
from tests.server.live_server import serving, wait_for
from tests.verified import verified_session, written

ZIP = {"Content-Type": "application/zip"}
TAKEN = "2025-03-30T01:{minute:02}:00+01:00"
SOLVED = "2025-04-01T08:15:00.000Z"


@contextmanager
def elsewhere() -> Generator[None]:
    """Live where the day is another one."""
    before = os.environ.get("TZ")
    os.environ["TZ"] = "Pacific/Kiritimati"
    time.tzset()
    try:
        yield
    finally:
        os.environ.pop("TZ") if before is None else os.environ.update(TZ=before)
        time.tzset()


def dated(folder: Path) -> Path:
    """Return a folder that was captured and solved in another year."""
    made = verified_session(3)
    for number, capture in enumerate(made.session.captures):
        made.session.captures[number] = capture.model_copy(
            update={"taken": TAKEN.format(minute=number), "clock": "device"}
        )
    written(made, folder)
    for path in (folder / "results").glob("*.json"):
        record = json.loads(path.read_text())
        del record["provenance"], record["seal"]
        path.write_text(json.dumps(signed_result({**record, "solved": SOLVED}, made.session)))
    return folder


def of_server(client: httpx.Client, session: str) -> dict[str, Any]:
    captures = client.get(f"/sessions/{session}/captures", params={"limit": 200}).json()["items"]
    answer = client.get(f"/sessions/{session}/answer").json()
    results = client.get(f"/sessions/{session}/results").json()
    return {
        "taken": {one["id"]: (one.get("taken"), one.get("clock")) for one in captures},
        "solved": answer["solved"],
        "results": {name: one["solved"] for name, one in results.items()},
    }


def of_archive(content: bytes) -> dict[str, Any]:
    files = {info.filename.partition("/data/")[2]: data for info, data in entries_of(content)}
    results = {
        name.removeprefix("results/").removesuffix(".json"): json.loads(data)
        for name, data in files.items()
        if name.startswith("results/") and name.endswith(".json")
    }
    return {
        "taken": {
            one["id"]: (one.get("taken"), one.get("clock"))
            for one in json.loads(files["session.json"])["captures"]
        },
        "solved": json.loads(files["answer.json"])["solved"],
        "results": {name: one["solved"] for name, one in results.items()},
    }


def imported(client: httpx.Client, content: bytes) -> str:
    session = client.post("/archives", content=content, headers=ZIP).raise_for_status().json()["id"]
    for job in client.get("/jobs", params={"session": session}).json()["items"]:
        wait_for(client, job["id"])
    return session


def of_folder(folder: Path) -> dict[str, Any]:
    """Return the dates in a folder, as `of_server` does."""
    session = json.loads((folder / "session.json").read_bytes())
    results = {path.stem: json.loads(path.read_bytes()) for path in (folder / "results").glob("*.json")}
    return {
        "taken": {one["id"]: (one.get("taken"), one.get("clock")) for one in session["captures"]},
        "solved": max(one["solved"] for one in results.values()),
        "results": {name: one["solved"] for name, one in results.items()},
    }


def journey(place: Path) -> dict[str, dict[str, Any]]:
    """Send a session everywhere; return the dates it has at each place, and `report`, the server's page."""
    folder = dated(place / "cell")
    packed = place / "by-command.zip"
    assert main(["archive", "pack", str(folder), "--no-scene", "--out", str(packed)]) == 0
    found = {"folder": of_folder(folder), "the command line's archive": of_archive(packed.read_bytes())}
    assert main(["archive", "unpack", str(packed), "--out", str(place / "bag")]) == 0
    found["unpacked"] = of_folder(place / "bag" / "data")
    cc.load(packed).save(place / "saved")
    found["saved by the library"] = of_folder(place / "saved")
    settings = Settings(data=place / "one", port=0, warm_up=False)
    with serving(settings) as client:
        session = imported(client, packed.read_bytes())
        found["server"] = of_server(client, session)
        again = client.get(f"/sessions/{session}/archive", params={"scene": False}).content
        found["server's archive"] = of_archive(again)
        found["report"] = {"text": client.get(f"/sessions/{session}/report").text}
        back_up(settings, place / "backup")
    restored = place / "two"
    assert main(["restore", str(place / "backup"), "--data", str(restored)]) == 0
    with serving(Settings(data=restored, port=0, warm_up=False)) as client:
        found["restored"] = of_server(client, session)
    with serving(Settings(data=place / "three", port=0, warm_up=False)) as client:
        found["imported again"] = of_server(client, imported(client, again))
    return found
