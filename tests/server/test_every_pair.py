"""A change of a field, and each download after it: all say whether they are stale, and no number changes.

Which fields make what stale is told field by field in `tests/core/test_graph.py`; `scancell bench every_pair`
tries all of them on all downloads, of the whole chain and its clouds.
"""

from typing import Any

import httpx
import pytest

from tests.server.downloads import Said, assert_told, downloads

SOLVED = {"tcp"}
CHANGES: dict[str, tuple[str, dict[str, Any], set[str]]] = {
    "a convention of as many numbers": ("", {"cell": {"pose_convention": "quaternion-wxyz"}}, SOLVED),
    "a capture's exclusion": ("/captures/p03", {"excluded": True}, SOLVED),
    "what nothing here reads": ("", {"cell": {"verification": {"tool_mm": 0.5}}}, set()),
}


@pytest.fixture(scope="module")
def before(shared_client: httpx.Client, solved: str) -> dict[str, Said]:
    found = downloads(shared_client, solved)
    assert not any(said.stale for said in found.values())
    return found


@pytest.mark.thorough
@pytest.mark.parametrize("what", CHANGES)
def test_after_a_change_every_download_says_the_truth(
    client: httpx.Client, solved: str, before: dict[str, Said], what: str
) -> None:
    path, change, stale = CHANGES[what]
    place = f"/sessions/{solved}{path}"
    record = client.get(place).json()
    undo = {name: record.get(name) for name in change}
    if "cell" in change:
        undo = {"cell": {name: record["cell"].get(name) for name in change["cell"]}}
    changed = client.patch(place, json=change)
    assert changed.status_code == 200, changed.text
    try:
        assert_told(downloads(client, solved), before, stale, what)
    finally:
        assert client.patch(place, json=undo).status_code == 200
