"""Every field of cell and captures changed, and all that can be downloaded after each: is it told as stale."""

import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import httpx
from harness import Row

from calib_core.archive.archive import pack
from calib_core.archive.folder import save_session, write_result
from calib_core.simulation import simulate
from calib_core.stages.pipeline import run as solve
from server.settings import Settings
from tests.core.test_graph import CAPTURE, CELL, OPTICS, READ_BY
from tests.server.downloads import assert_told, downloads
from tests.server.live_server import serving

_STEPS = {"p1": "tcp", "t1": "turntable", "s1": "scan"}
_FEW = ("pose_convention", "sphere_diameter_mm", "merge.voxel_mm", "turntable.direction", "wanted_mm")
# What the server refuses to change, or what takes a file that is not there.
_NOT_BY_PATCH = ("id", "kind", "files", "format", "format_settings")


def run(full: bool) -> Iterator[Row]:
    """Yield the figures; five fields of the cell and three of the captures without `full`."""
    data = tempfile.TemporaryDirectory()
    with data, serving(Settings(data=Path(data.name) / "data", port=0, warm_up=False)) as client:
        session = _whole_chain(client, Path(data.name))
        client.post(f"/sessions/{session}/release", json={"why": "before"}).raise_for_status()
        cell_id = client.get(f"/sessions/{session}/answer").json()["cell"]
        released = client.get(f"/cells/{cell_id}/answer").json()
        before = downloads(client, session)
        tried, wrong = 0, list[str]()
        for what, path, change, stale in _changes(client, session, full):
            tried += 1
            try:
                _try(client, path, change, lambda stale=stale, what=what: assert_told(
                    downloads(client, session), before, stale, what
                ))  # fmt: skip
                now = client.get(f"/cells/{cell_id}/answer").json()
                assert now == released, "what was released has changed"
            except AssertionError as error:
                wrong.append(f"{what}: {error}")
        told = f"{len(wrong)} of {tried * len(before)} ({tried} fields, {len(before)} downloads)"
        yield Row("a change and a download: staleness or numbers wrong", "0", told, not wrong)
        for line in wrong:
            yield Row(line[:300], "", "")


def _whole_chain(client: httpx.Client, folder: Path) -> str:
    """Return the session of a solved chain with three merged scans, as an archive brings it."""
    simulated = simulate("cell", 1)
    scans = [capture.id for capture in simulated.session.captures if capture.step == "scan"]
    record = simulated.session.to_json()
    record["captures"] = [capture for capture in record["captures"] if capture["id"] not in scans[3:]]
    record["cell"]["merge"] = {"mesh": "none", "voxel_mm": 1.0}
    session = type(simulated.session).model_validate(record)
    files = {name: simulated.files[name] for capture in session.captures for name in capture.files}
    made: dict[str, bytes] = {}

    def store(name: str, pieces: Any) -> None:
        made[name] = b"".join(pieces)

    results = solve(session, files.__getitem__, "all", None, store)
    save_session(folder / "session", session, {**files, **made})
    for stage, result in results.items():
        write_result(folder / "session", stage, result, session)
    pack(folder / "session", folder / "session.zip")
    content = (folder / "session.zip").read_bytes()
    answer = client.post("/archives", content=content, headers={"Content-Type": "application/zip"})
    assert answer.status_code == 201, answer.text
    return answer.json()["id"]


def _changes(
    client: httpx.Client, session: str, full: bool
) -> Iterator[tuple[str, str, dict[str, Any], set[str]]]:
    """Yield what is changed, where, by what, and the stages that it makes stale."""
    for path, (value, stale) in CELL.items():
        if not full and path not in _FEW:
            continue
        name, _, inner = path.partition(".")
        now = client.get(f"/sessions/{session}").json()["cell"].get(name)
        if inner:
            value = {**(now or {}), inner: value}
        yield (
            f"cell.{path}",
            f"/sessions/{session}",
            {"cell": {name: value}},
            stale - OPTICS if now != value else set(),
        )
    captures = client.get(f"/sessions/{session}/captures", params={"limit": 200}).json()["items"]
    for key, step in _STEPS.items():
        capture = next(c for c in captures if c["step"] == step)
        for field, (value, read_in) in CAPTURE.items():
            if field in _NOT_BY_PATCH or not (full or field == "excluded"):
                continue
            stale = READ_BY[key] if key in read_in and capture.get(field) != value else set[str]()
            place = f"/sessions/{session}/captures/{capture['id']}"
            yield f"{step}: {field}", place, {field: value}, stale


def _try(client: httpx.Client, path: str, change: Mapping[str, Any], look: Any) -> None:
    """Change, look, and change back; a change that is refused changes nothing, and needs no look."""
    record = client.get(path).json()
    undo: dict[str, Any] = {name: record.get(name) for name in change}
    if "cell" in change:
        undo = {"cell": {}}
        for name, value in change["cell"].items():
            before = record["cell"].get(name)
            # A merge patch keeps what it does not name: what was not there is removed by name.
            added = dict.fromkeys(value) if isinstance(value, dict) and isinstance(before, dict) else None
            undo["cell"][name] = before if added is None else {**added, **before}
    if client.patch(path, json=dict(change)).status_code != 200:
        return
    try:
        look()
    finally:
        client.patch(path, json=undo).raise_for_status()
