"""What pages ask is worked out in a process of its own, with the same answers; it heals, and leaves nothing."""

import json
import os
import signal
import threading
from collections.abc import Iterator
from typing import Any

import httpx
import numpy as np
import psutil
import pytest

from calib_core.errors import InputError
from calib_core.guidance import advice
from calib_core.guidance import interim_estimate as so_far
from calib_core.records import Measured, parse_session
from calib_core.simulation import simulate
from calib_core.stages.guide import guide
from server.guides import Guides
from server.jobs.page_process import PageProcess, PageProcessError
from server.measuring import measure
from server.scenes.advice import SceneAdviser, advice_for
from server.scenes.scene_input import SceneInput
from server.scenes.stored import scene_input
from server.store.process_data import SessionTexts
from tests.server.forked_commands import fork_from_one
from tests.server.live_server import simulated_session

CELL = simulate("turntable", 4)


@pytest.fixture(scope="module")
def pages() -> Iterator[PageProcess]:
    fork_from_one()
    process = PageProcess()
    yield process
    process.stop()


@pytest.fixture(scope="module")
def seen() -> list[Measured]:
    """Return what is seen in the simulated captures."""
    return [measure(CELL.session, capture, CELL.files.__getitem__) for capture in CELL.session.captures]


def scene(seen: list[Measured], captures: slice) -> SceneInput:
    """Return the scene of some of them, before anything is solved."""
    session = CELL.session.model_copy(update={"captures": CELL.session.captures[captures]})
    return scene_input(session, CELL.files.__getitem__, seen[captures], {})


def worked_out_here() -> list[int]:
    """Return how much of what is heavy was asked for in this process by now."""
    caches: tuple[Any, ...] = (advice._advised, so_far._so_far, so_far._table_so_far)  # pyright: ignore[reportPrivateUsage]
    return [cache.cache_info().hits + cache.cache_info().misses for cache in caches]


@pytest.mark.thorough
def test_a_guide_over_rest_is_that_of_the_library_and_worked_out_elsewhere(client: httpx.Client) -> None:
    session = simulated_session(client, captures=6, seed=11)
    before = worked_out_here()
    got = client.get(f"/sessions/{session}/guide").json()
    assert worked_out_here() == before  # the server runs in this process
    record = client.get(f"/sessions/{session}").json()
    rows = client.get(f"/sessions/{session}/captures").json()["items"]
    measured = [Measured.model_validate(row["measured"]) for row in rows]
    asked = {name: record[name] for name in ("name", "cell", "captures")}
    assert got == guide(parse_session(asked, session), measured, {}).to_json()
    assert got["current"]["meter"]["history"]


@pytest.mark.thorough
def test_a_scene_is_advised_as_here(pages: PageProcess, seen: list[Measured]) -> None:
    told = 0
    for captures in (slice(2), slice(9), slice(None)):
        drawn = scene(seen, captures)
        before = worked_out_here()
        there = SceneAdviser(pages)(drawn)
        assert worked_out_here() == before
        here = advice_for(drawn)
        assert there.next_pose == here.next_pose
        assert numbers(there.so_far) == numbers(here.so_far)
        assert numbers(there.table_so_far) == numbers(here.table_so_far)
        told += (here.so_far is not None) + (here.table_so_far is not None)
    assert told >= 2


def numbers(known: Any) -> dict[str, str]:
    """Return a record's fields with all their digits."""
    with np.printoptions(floatmode="unique", threshold=10_000):
        return {} if known is None else {name: repr(value) for name, value in vars(known).items()}


def test_a_process_that_was_killed_is_replaced(pages: PageProcess) -> None:
    first = pages.ask(os.getpid)
    assert first not in (os.getpid(), None)
    assert pages.ask(os.getpid) == first
    os.kill(first, signal.SIGKILL)
    second = pages.ask(os.getpid)
    assert second != first
    assert not psutil.pid_exists(first)


def test_a_question_that_ends_the_process_is_given_up_and_the_next_is_answered(pages: PageProcess) -> None:
    with pytest.raises(PageProcessError) as caught:
        pages.ask(signal.raise_signal, signal.SIGKILL)
    assert caught.value.status_code == 503
    assert pages.ask(abs, -3) == 3


def test_what_takes_too_long_is_given_up(pages: PageProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    late = pages.ask(os.getpid)
    with monkeypatch.context() as patch:
        patch.setattr(pages, "_timeout_s", 1e-4)
        with pytest.raises(PageProcessError, match=r"0\.0001 s"):
            pages.ask(sum, range(10_000_000))
    assert pages.ask(os.getpid) != late


def test_errors_come_back_as_they_are(pages: PageProcess) -> None:
    with pytest.raises(InputError, match="cell"):
        pages.ask(parse_session, {"name": "no cell"}, "record")
    with pytest.raises(ZeroDivisionError) as caught:
        pages.ask(divmod, 1, 0)
    assert "question(*given)" in caught.value.__notes__[0]  # where it was raised
    assert pages.ask(divmod, 7, 2) == (3, 1)


def test_it_is_gone_once_it_is_stopped() -> None:
    process = PageProcess()
    pid = process.ask(os.getpid)
    process.stop()
    assert not psutil.pid_exists(pid)
    with pytest.raises(PageProcessError):
        process.ask(abs, 1)


def test_many_who_ask_at_once_wait_for_one_guide_of_the_newest_state(
    pages: PageProcess, seen: list[Measured]
) -> None:
    captures = [capture.model_dump_json(exclude_unset=True) for capture in CELL.session.captures]
    record = CELL.session.model_copy(update={"captures": []}).model_dump_json(exclude_unset=True)
    measured = [one.model_dump_json(exclude_unset=True) for one in seen]
    loaded: list[str] = []
    loading, go_on = threading.Event(), threading.Event()

    def load(session: str) -> SessionTexts:
        loaded.append(session)
        count = 5 if len(loaded) == 1 else 6
        loading.set()
        assert go_on.wait(300)
        return SessionTexts(session, record, tuple(captures[:count]), tuple(measured[:count]), {}, {})

    guides = Guides(load, pages)
    first = guides.ask("a")
    assert loading.wait(300)
    later = [guides.ask("a") for _ in range(5)]
    go_on.set()
    assert len({id(answer) for answer in later}) == 1
    names = [json.loads(answer.result(60))["last_capture"]["capture"] for answer in (first, later[0])]
    assert names == [CELL.session.captures[place].id for place in (4, 5)]
    assert loaded == ["a", "a"]
    guides.stop()
