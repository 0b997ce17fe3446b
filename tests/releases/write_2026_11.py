"""Writes `tests/releases/2026-11` with the product as it was at commit 82c57c61; not with a later tree.

    git worktree add ../then 82c57c61
    cp tests/releases/write_2026_11.py ../then/tests/releases/
    cd ../then && python -m tests.releases.write_2026_11 OUT

`folders.zip` holds session folders as `scancell run` leaves them, `archives/` each of them packed, and `data.zip`
a server's data folder without what it keeps to be faster: the same archives imported, solved anew, changed and
released.
"""

import json
import shutil
import sys
import tempfile
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from calib_core.archive.folder import save_session, to_json_bytes
from calib_core.records import Session
from calib_core.simulation import (
    SimulatedSession,
    TcpScenario,
    retake,
    simulate,
    simulate_table,
    simulate_tcp,
    simulate_verify,
)
from calib_core.simulation.frame_cell import FrameScenario, simulate_frames
from calib_core.simulation.part_cell import PartScenario
from calib_core.simulation.part_scan import PartScanOptions
from calib_core.simulation.table_cell import TABLE_SCENARIOS
from calib_core.simulation.verify_cell import VERIFY_SCENARIOS
from calib_core.simulation.whole_cell import WholeScenario, with_scans
from server.cli import main
from server.settings import Settings
from tests.server.live_server import serving

CELL = "cell-of-2026-11"
_ONE_DATE = (2026, 11, 23, 0, 0, 0)


def sessions() -> dict[str, SimulatedSession]:
    """Return the sessions by name, all small: plain, with nothing told, and troubled ones."""
    return {
        "tcp": simulate("tcp", 101),
        "tcp-untold": simulate("tcp-unknown-sigmas", 102),
        "tcp-spoiled": simulate("tcp-spoiled", 103),
        "tcp-mixed": simulate("tcp-mixed", 104),
        "tcp-rotation-only": simulate("tcp-rotation-only", 105),
        "turntable": simulate("turntable", 106),
        "turntable-untold": simulate("turntable-unknown-sigmas", 107),
        "turntable-wobble": simulate("turntable-wobble", 108),
        "merge": _merge(109),
        "verify": simulate_verify(110, VERIFY_SCENARIOS["verify"], "verify"),
        "recheck": _recheck(111),
        "frames": _frames(112),
    }


def _merge(seed: int) -> SimulatedSession:
    whole = WholeScenario(part=PartScenario(scans=4, scanner=PartScanOptions(pitch_mm=3.0)))
    return with_scans(simulate_table(seed, TABLE_SCENARIOS["turntable"], "cell"), whole, seed)


def _recheck(seed: int) -> SimulatedSession:
    taken = simulate_tcp(seed, TcpScenario(), "tcp")
    record, files = taken.session.to_json(), dict(taken.files)
    for number, pose in enumerate(("p02", "p07", "p12")):
        again, own = retake(taken, pose, f"r{number + 1:02d}", seed + number)
        record["captures"].append(again.to_json() | {"step": "recheck"})
        files |= own
    return replace(taken, session=Session.model_validate(record), files=files)


def _frames(seed: int) -> SimulatedSession:
    few = FrameScenario("few frames", camera_views=5, plane_views=4, translations=3, orientations=5)
    return SimulatedSession(*simulate_frames(few, "frames", seed), None)


def write_folders(place: Path) -> list[Path]:
    """Write every session as a folder, solved by `scancell run`."""
    folders: list[Path] = []
    for name, simulated in sessions().items():
        folder = place / name
        record = simulated.session.to_json()
        session = Session.model_validate(record | {"name": name, "cell": {**record["cell"], "id": CELL}})
        save_session(folder, session, {**simulated.files, "truth.json": to_json_bytes(_plain(simulated.truth))})
        assert main(["run", str(folder), "--quiet"]) in (0, 1), name
        folders.append(folder)
    return folders


def _plain(truth: dict[str, Any]) -> dict[str, Any]:
    return json.loads(json.dumps(truth, default=np.ndarray.tolist))


def write_archives(folders: list[Path], place: Path) -> list[Path]:
    """Pack every folder."""
    place.mkdir(parents=True)
    archives = [place / f"{folder.name}.zip" for folder in folders]
    for folder, archive in zip(folders, archives, strict=True):
        assert main(["archive", "pack", str(folder), "--out", str(archive), "--no-scene", "--quiet"]) == 0
    return archives


def write_data(data: Path, archives: list[Path]) -> None:
    """Import the archives into a server; solve, change, release and roll back there."""
    with serving(Settings(data=data, port=0, warm_up=False)) as client:
        ids = {archive.stem: _imported(client, archive) for archive in archives}
        first = ids["turntable"]
        _released(client, first, "set up")
        _post(client, f"/sessions/{first}/solve/all", params={"wait": 120})
        patched = client.patch(f"/sessions/{first}/captures/p03", json={"excluded": True})
        assert patched.status_code == 200, patched.text
        _post(client, f"/sessions/{first}/solve/all", params={"wait": 120})
        _released(client, first, "p03 was bumped")
        _released(client, ids["tcp"], "without the table")
        _post(client, f"/cells/{CELL}/rollback", json={"why": "scans are off"})
        stale = client.patch(f"/sessions/{ids['tcp-mixed']}/captures/p05", json={"excluded": True})
        assert stale.status_code == 200, stale.text


def _imported(client: httpx.Client, archive: Path) -> str:
    headers = {"Content-Type": "application/zip"}
    return _post(client, "/archives", content=archive.read_bytes(), headers=headers)["id"]


def _released(client: httpx.Client, session: str, why: str) -> None:
    _post(client, f"/sessions/{session}/release", json={"why": why})


def _post(client: httpx.Client, path: str, **more: Any) -> dict[str, Any]:
    answer = client.post(path, **more)
    assert answer.status_code < 300, (path, answer.text)
    return answer.json()


def zipped(folder: Path, file: Path, without: tuple[str, ...] = ()) -> None:
    """Write all files of a folder into a zip, with one date."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as target:
        for path in sorted(folder.rglob("*")):
            name = path.relative_to(folder).as_posix()
            if path.is_file() and not any(part in without for part in Path(name).parts):
                entry = zipfile.ZipInfo(name, _ONE_DATE)
                entry.compress_type = zipfile.ZIP_DEFLATED
                target.writestr(entry, path.read_bytes())


def write(out: Path) -> None:
    """Write everything into a folder that is new."""
    out.mkdir(parents=True)
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(temporary)
        folders = write_folders(place / "folders")
        archives = write_archives(folders, out / "archives")
        # Frames are half of all bytes: their archive alone has them.
        write_data(place / "data", [archive for archive in archives if archive.stem != "frames"])
        shutil.rmtree(place / "folders" / "frames")
        zipped(place / "folders", out / "folders.zip", without=(".scancell",))
        zipped(place / "data", out / "data.zip", without=("tmp", "observations"))


if __name__ == "__main__":
    write(Path(sys.argv[1]))
