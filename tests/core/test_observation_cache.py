"""Captures are measured once: what was seen is kept by content, and what depends on a change is seen anew."""

import shutil
import sqlite3
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib_core.archive.folder import load_session, result_data, save_session
from calib_core.archive.observation_store import KeptObservations
from calib_core.captures import observation_cache as kept
from calib_core.captures import observe
from calib_core.captures.capture_observation import Seen
from calib_core.captures.observation_bytes import from_bytes, to_bytes
from calib_core.errors import MeasurementError
from calib_core.records import ReadFile, Session
from calib_core.review.replay import replay
from calib_core.simulation import SimulatedSession, simulate
from calib_core.sphere.arc import ArcFit
from calib_core.stages.pipeline import run

Fits = list[str]
FILE = ".scancell/observations.sqlite"


@pytest.fixture(scope="module")
def cell() -> SimulatedSession:
    return simulate("tcp", 3)


@pytest.fixture
def fits(monkeypatch: pytest.MonkeyPatch) -> Fits:
    """Every fit of an arc or a sphere from here on; nothing is remembered from before."""
    made: Fits = []

    def counted(name: str) -> Callable[..., Any]:
        fit = getattr(observe, name)

        def fitting(*given: Any) -> Any:
            made.append(name)
            return fit(*given)

        return fitting

    for name in ("fit_arc", "fit_sphere"):
        monkeypatch.setattr(observe, name, counted(name))
    forget(monkeypatch)
    return made


def forget(monkeypatch: pytest.MonkeyPatch) -> None:
    """Empty this process's memory, as another process's is."""
    monkeypatch.setattr(kept, "_memory", type(kept._memory)(64_000_000))  # pyright: ignore[reportPrivateUsage]


@pytest.fixture
def folder(cell: SimulatedSession, tmp_path: Path) -> Path:
    save_session(tmp_path / "session", cell.session, cell.files)
    return tmp_path / "session"


def seen(folder: Path) -> list[bytes]:
    """Look at every capture of a folder, and return what the solvers get of it."""
    return seen_in(*load_session(folder))


def seen_in(session: Session, read: ReadFile) -> list[bytes]:
    found = [observe.observe_capture(session, capture, read) for capture in session.captures]
    return [o.points_in_laser_mm.tobytes() + o.center_covariance.tobytes() for o in found]


@pytest.mark.thorough
def test_a_second_run_and_its_answer_measure_nothing_and_a_replay_all(
    cell: SimulatedSession, folder: Path, fits: Fits, monkeypatch: pytest.MonkeyPatch
) -> None:
    count = len(cell.session.captures)
    session, read = load_session(folder)
    first = result_data(run(session, read, "tcp")["tcp"])
    assert len(fits) == count
    forget(monkeypatch)
    assert result_data(run(*load_session(folder), "tcp")["tcp"]) == first
    assert len(fits) == count
    forget(monkeypatch)
    assert replay(session, read, {"tcp": first}).equal
    assert len(fits) == 2 * count


def test_what_a_fit_depends_on_is_measured_anew_and_nothing_else(
    cell: SimulatedSession, folder: Path, fits: Fits, monkeypatch: pytest.MonkeyPatch
) -> None:
    session, read = load_session(folder)
    seen_in(session, read)
    count = len(fits)
    first, *others = session.captures
    assert session.cell.sphere_diameter_mm is not None

    def fits_of(changed: Session) -> int:
        before = len(fits)
        forget(monkeypatch)
        seen_in(changed, read)
        return len(fits) - before

    arm = session.cell.robot.model_copy(update={"position_sigma_mm": 0.3})
    assert fits_of(with_cell(session, robot=arm)) == 0
    assert fits_of(with_cell(session, sphere_diameter_mm=session.cell.sphere_diameter_mm + 0.01)) == count
    moved = first.model_copy(update={"excluded": True, "pose": others[0].pose})
    assert fits_of(session.model_copy(update={"captures": [moved, *others]})) == 0
    (folder / first.files[0]).write_bytes(cell.files[others[0].files[0]] + b"\n")
    assert fits_of(session) == 1


def with_cell(session: Session, **changes: Any) -> Session:
    return session.model_copy(update={"cell": session.cell.model_copy(update=changes)})


def test_that_nothing_is_seen_is_kept_with_what_to_do(fits: Fits, tmp_path: Path) -> None:
    session = simulate("tcp", 3).session
    capture = session.captures[0]
    line = b"\n".join(b"%.1f,%.2f" % (x, 200.0) for x in np.linspace(-40, 40, 200))
    read = kept.KeepingReader(lambda _: line, KeptObservations(tmp_path))
    said: list[str] = []
    for _ in range(2):
        with pytest.raises(MeasurementError) as error:
            observe.observe_capture(session, capture, read)
        said.append(str(error.value))
    assert said[0] == said[1]
    assert capture.files[0] in said[0]
    assert len(fits) == 1


@pytest.mark.parametrize("content", [b"", b"no database", b"SQLite format 3\x00" + b"\xff" * 4000])
def test_a_damaged_file_is_no_harm(
    folder: Path, fits: Fits, monkeypatch: pytest.MonkeyPatch, content: bytes
) -> None:
    first = seen(folder)
    shutil.rmtree(folder / ".scancell")
    (folder / ".scancell").mkdir()
    (folder / FILE).write_bytes(content)
    forget(monkeypatch)
    assert seen(folder) == first


def test_damaged_values_are_measured_anew(folder: Path, fits: Fits, monkeypatch: pytest.MonkeyPatch) -> None:
    first = seen(folder)
    count = len(fits)
    with sqlite3.connect(folder / FILE) as file:
        file.execute("UPDATE kept SET value = substr(value, 1, length(value) - 8) WHERE rowid % 3 = 1")
        file.execute("UPDATE kept SET value = 'text' WHERE rowid % 3 = 2")
    forget(monkeypatch)
    assert seen(folder) == first
    mended = len(fits)
    assert count < mended < 2 * count
    forget(monkeypatch)
    assert seen(folder) == first
    assert len(fits) == mended  # what was measured anew stands in the place of the damaged


def test_a_folder_that_cannot_be_written_is_solved_all_the_same(
    cell: SimulatedSession, folder: Path, fits: Fits, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / ".scancell").write_text("a file where the folder would be")
    first = seen(folder)
    forget(monkeypatch)
    assert seen(folder) == first
    assert len(fits) == 2 * len(cell.session.captures)


def test_the_oldest_go_where_the_file_grows_too_large(tmp_path: Path) -> None:
    keeper = KeptObservations(tmp_path, most_bytes=1_000_000)
    for number in range(300):
        keeper.put(f"{number}", bytes(10_000))
    assert keeper.get("0") is None
    assert keeper.get("299") == bytes(10_000)
    assert (tmp_path / "observations.sqlite").stat().st_size < 2_500_000


def test_what_was_seen_comes_back_bit_for_bit() -> None:
    chance = np.random.default_rng(1)
    arc = ArcFit(
        chance.normal(size=2),
        1 / 3,
        chance.normal(size=(3, 3)),
        0.1,
        float("nan"),
        np.array([True, False]),
        1.0,
        -1,
        0.2,
    )
    seen = Seen(chance.normal(size=(2, 2)), arc.inliers, arc)
    back = from_bytes(to_bytes(seen))
    assert isinstance(back, Seen)
    assert isinstance(back.fit, ArcFit)
    assert back.points.tobytes() == seen.points.tobytes()
    for name in ("center_mm", "covariance", "inliers"):
        assert getattr(back.fit, name).tobytes() == getattr(arc, name).tobytes()
    assert repr(replace(back.fit, center_mm=0, covariance=0, inliers=0)) == repr(  # pyright: ignore[reportArgumentType]
        replace(arc, center_mm=0, covariance=0, inliers=0)  # pyright: ignore[reportArgumentType]
    )
    assert from_bytes(to_bytes(seen)[:-1]) is None
