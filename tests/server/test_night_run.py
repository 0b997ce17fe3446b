"""The night run of docs/examples: a drift and both faults; `scancell bench night_run` goes through 60 nights."""

import importlib.util
import sys
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from scancell_client import ProblemError, Scancell

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "night_run.py"


def example() -> Any:
    spec = importlib.util.spec_from_file_location("night_run", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["night_run"] = module
    spec.loader.exec_module(module)
    return module


def go_through(address: str, count: int, hit_in: int, knocked_in: int) -> list[Any]:
    """Go through so many nights; assert of each what was done, and that what is in force is near the truth."""
    module = example()
    cell = module.DriftingCell(hit_in, knocked_in)
    done: list[Any] = []
    with Scancell(address) as api:
        nights = module.Nights(api, cell.cell, cell.measure)
        for number in range(1, count + 1):
            cell.begin(number)
            before = nights.in_force()
            night = nights.run()
            done.append(night)
            if number == hit_in:
                assert night.did == "alarm", night
                # The same answer goes on, marked: the cell has changed.
                assert before["faults"] == []
                now = nights.in_force()
                told, *others = now["findings"]
                assert told["code"] == "cell-drifted"
                assert {**now, "findings": others} == {**before, "faults": ["drift"]}
                with pytest.raises(ProblemError, match="acknowledge"):
                    api.cells_release(night.session, {"why": "looked at"})
                api.cells_acknowledge_fault(cell.cell["id"], {"fault": "drift", "why": "the scanner was hit"})
                api.cells_release(night.session, {"why": "looked at"})
            elif number == knocked_in:
                assert (night.did, night.rechecked) == ("approve", True), night
            else:
                assert night.did == "approve", night
            assert off_mm(nights.in_force(), cell.tool0_from_laser) < 0.5, (number, night)
    return done


def off_mm(answer: Any, truth: Any) -> float:
    """Return how far the tool in force is off the truth where the scanner works."""
    point = np.array([0.0, 0.0, 180.0, 1.0])
    return float(np.linalg.norm((np.array(answer["tool0_from_laser"]["matrix"]) @ point - truth @ point)[:3]))


@pytest.mark.thorough
def test_a_few_nights_with_both_faults(client: httpx.Client) -> None:
    address = str(client.base_url).removesuffix("/api/v1/")
    done = go_through(address, 3, hit_in=2, knocked_in=3)
    assert [night.rechecked for night in done] == [False, True, True]
    history = client.get("/cells/press-7/history").json()
    assert len(history["releases"]) == 3
    assert "recheck" in history["releases"][0]["why"]
