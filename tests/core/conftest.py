"""A simulated session, solved and packed once for all tests of archives and reports."""

from pathlib import Path
from typing import Any

import pytest

from calib_core.archive.archive import pack
from calib_core.archive.folder import load_session, result_data, save_session, to_json_bytes, write_result
from calib_core.records import Session
from calib_core.simulation import simulate
from calib_core.stages.pipeline import run


@pytest.fixture(scope="session")
def solved_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session folder with its result; tests read it and leave it as it is."""
    folder = tmp_path_factory.mktemp("solved") / "cell"
    simulated = simulate("tcp-spoiled", 7)
    save_session(folder, simulated.session, {**simulated.files, "truth.json": to_json_bytes(simulated.truth)})
    session, read = load_session(folder)
    write_result(folder, "tcp", run(session, read)["tcp"], session)
    return folder


@pytest.fixture(scope="session")
def turntable_results() -> tuple[Session, dict[str, dict[str, Any]]]:
    """A session with a turntable, and its results as JSON data; tests leave them as they are."""
    simulated = simulate("turntable", 3)
    results = run(simulated.session, simulated.files.__getitem__)
    return simulated.session, {stage: result_data(result) for stage, result in results.items()}


@pytest.fixture(scope="session")
def packed(solved_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The session's archive."""
    file = tmp_path_factory.mktemp("packed") / "cell.zip"
    pack(solved_folder, file, {"report.html": b"<p>report</p>"})
    return file.read_bytes()
