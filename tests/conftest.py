"""Properties are tested with the same examples every time, and take the time that a busy machine gives them.

The browser of all browser tests is here, and what watches it.
"""

from __future__ import annotations

import os

# As the command line does, before numpy is there: for many small solves at once, two threads each take six times
# as long.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import gc
import getpass
import pickle
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

from tests.dealing import dealt, without_thorough
from tests.windows.open_files import refuse_changes_of_open_files

if TYPE_CHECKING:  # most tests need no browser
    from playwright.sync_api import Browser

    from calib_core.simulation import SimulatedSession
    from tests.web.browsing import Watch

# What tests sign is signed with a key of their own, which all processes of a run share.
os.environ.setdefault(
    "SCANCELL_KEY_FILE", str(Path(tempfile.gettempdir()) / f"scancell-tests-{getpass.getuser()}" / "key.pem")
)

# Else each process that a test starts compiles all sources again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

refuse_changes_of_open_files()

gc.disable()  # until all tests are collected: to look for garbage meanwhile takes a fifth of the time

settings.register_profile("scancell", deadline=None, derandomize=True, database=None, max_examples=40)
settings.load_profile("scancell")

# Those of single tests that take longest, and files of several; the longest first.
LONGEST = (
    "web/test_turntable_walk.py",
    "web/test_live_panel.py",
    "web/test_ways.py",
    "server/test_outages.py",
    "web/test_restart.py",
    "server/test_kill.py",
    "web/test_frames_walk.py",
    "server/test_access.py",
    "server/test_schema_fuzzing.py",
    "package/test_wheel.py",
    "web/test_figures.py",
    "web/test_walk.py",
    "web/test_problems_page.py",
    "server/test_demo.py",
    "server/test_kernels.py",
    "core/test_compiled.py",
    "web/test_random_walk.py",
    "server/test_robot_programs.py",
    "server/test_live_calibration.py",
    "web/test_scene_tools.py",
)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--brief", action="store_true", help="leave out what is marked as thorough, as `make test` does"
    )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what is asked to; let the longest tests begin first, a like share in each process.

    Begun last, one process would do them alone.
    """
    if config.getoption("brief"):
        brief = set(without_thorough(items))
        config.hook.pytest_deselected(items=[item for item in items if item not in brief])
        items[:] = [item for item in items if item in brief]
    place = {name: number for number, name in enumerate(LONGEST)}
    of = {item: place.get("/".join(item.path.parts[-2:]), -1) for item in items}
    longest = sorted((item for item in items if of[item] >= 0), key=of.__getitem__)
    items[:] = dealt(longest, [item for item in items if of[item] < 0])


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop() -> None:
    """Look for garbage as seldom as the server does, and never among modules and collected tests, which stay."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000)
    gc.enable()


@pytest.fixture(scope="session")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, int], SimulatedSession]:
    """Simulated frames by scenario and seed: rendered once for all tests of a run, in whichever process."""
    from calib_core.simulation import simulate

    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    def of(scenario: str, seed: int) -> SimulatedSession:
        kept = shared / f"rendered-{scenario}-{seed}.pickle"
        if not kept.exists():
            written = kept.with_suffix(f".{os.getpid()}")
            written.write_bytes(pickle.dumps(simulate(scenario, seed)))
            written.replace(kept)
        return pickle.loads(kept.read_bytes())

    return of


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    from playwright.sync_api import expect, sync_playwright

    from tests.web.browsing import BROWSER_ARGUMENTS, CHROMIUM

    expect.set_options(timeout=120_000)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=BROWSER_ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture
def watch(chromium: Browser) -> Iterator[Watch]:
    """What watches the test's pages: each asks its own server alone and complains of nothing unannounced."""
    from tests.web.browsing import watching

    with watching(chromium) as watch:
        yield watch


@pytest.fixture
def browser(chromium: Browser, watch: Watch) -> Browser:
    """The browser, all of whose pages are watched."""
    return chromium
