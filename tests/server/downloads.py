"""All that can be downloaded of a session's answer: what each says of being stale, and the numbers in it."""

import hashlib
import json
import re
import zipfile
from collections import Counter
from dataclasses import dataclass, replace
from io import BytesIO
from typing import Any

import httpx

from calib_core.findings.codes.faults import FAULT_CODES

ALLOWED = {"allow": "stale,fail"}
_NUMBER = re.compile(r"-?\d+\.\d{3,}")


@dataclass(frozen=True)
class Said:
    """What one download says: the stage that it rests on, whether that is stale, and a hash of its numbers.

    `values` are an export's numbers themselves: a stale one leaves out what other stale stages have found.
    """

    stage: str
    stale: bool
    numbers: str
    values: tuple[str, ...] = ()


_FAULTS = {code.name for code in FAULT_CODES.values()}
_TOLD = ("faults", "stale", "budget", "workpiece_sigma_mm", "cell")
"""Of an answer: what says that it is stale, what a stale one leaves out, and the name that the cell has now."""


def downloads(client: httpx.Client, session: str) -> dict[str, Said]:
    """Return what each download of a session says, by name; asserts that header, body and refusals agree."""
    place = f"/sessions/{session}"
    answer = client.get(f"{place}/answer")
    stage = answer.json()["stage"]
    assert answer.json()["budget"] is None or not answer.json()["stale"]
    found = {"answer": _of(answer, stage, answer.json()["stale"], _without_faults(answer.json()), *_TOLD)}
    results: dict[str, Any] = client.get(f"{place}/results").json()
    for name, result in results.items():
        alone = client.get(f"{place}/results/{name}").json()
        assert alone["stale"] is result["stale"]
        matrices = {field: alone[field] for field in ("tool0_from_laser", "base_from_turntable") if field in alone}
        found[f"results/{name}"] = Said(name, alone["stale"], _hash([matrices, alone.get("pose_convention")]))
    for export in client.get("/exports").json()["items"]:
        said = _export(client, f"{place}/exports/{export['name']}", stage)
        if said is not None:
            found[f"exports/{export['name']}"] = said
    report = client.get(f"{place}/report")
    assert _says_stale(report.text) or report.headers["Scancell-Stale"] == "false"
    found["report"] = _of(report, stage, None, [])
    found["archive"] = _archive(client.get(f"{place}/archive", params={"scene": False}), answer, stage)
    moment = client.get(f"{place}/timeline").json()["items"][-1]["place"]
    frames = client.get(f"{place}/timeline/{moment}").json()["frames"]
    found["timeline"] = Said(stage, frames["stale"], _hash([frames["pose_convention"], frames["conventions"]]))
    budget = client.get(f"{place}/budget").json()
    found["budget"] = Said(stage, budget["stale"], "")
    typed = " ".join(str(number) for number in answer.json()["tool0_from_laser"]["numbers"])
    back = client.post(f"{place}/read-back", files={"numbers": (None, typed)})
    assert back.json()["equal"], back.text
    assert back.json()["faults"] == answer.json()["faults"]
    found["read-back"] = _of(back, stage, None, [])
    return found | _clouds(client, place)


def _clouds(client: httpx.Client, place: str) -> dict[str, Said]:
    listed = client.get(f"{place}/clouds")
    if not listed.json()["items"]:
        return {}
    found = {"clouds": _of(listed, "merge", None, listed.json())}
    for file in listed.json()["items"]:
        for ending in file["formats"]:
            name = f"{file['name'].rpartition('.')[0]}.{ending}"
            given = client.get(f"{place}/clouds/{name}")
            found[f"clouds/{name}"] = _of(given, "merge", None, hashlib.sha256(given.content).hexdigest())
    for look, query in (("section", {"at_mm": 20}), ("deviation", {"against": "sphere"})):
        given = client.get(f"{place}/merged/{look}", params=query)
        assert given.status_code == 200, given.text
        found[f"merged/{look}"] = _of(given, "merge", None, given.json())
    return found


def _export(client: httpx.Client, path: str, stage: str) -> Said | None:
    """Return what an export says; None where it needs what the session lacks."""
    given, plain = client.get(path, params=ALLOWED), client.get(path)
    if given.status_code in (409, 422):
        # One that moves a robot is never given of a stale answer; others want a table that may be missing.
        assert plain.status_code == given.status_code
        refused_as_stale = "inputs have changed" in given.json()["detail"]
        return Said(stage, True, "refused") if refused_as_stale else None
    assert given.status_code == 200, given.text
    stale = given.headers["Scancell-Stale"] == "true"
    assert (plain.status_code == 409) == (stale or given.headers["Scancell-Verdict"] == "fail"), path
    assert _says_stale(given.text) or not stale, path
    values = sorted(_NUMBER.findall(given.text))
    return replace(_of(given, stage, None, values), values=tuple(values))


def _archive(given: httpx.Response, answer: httpx.Response, stage: str) -> Said:
    with zipfile.ZipFile(BytesIO(given.content)) as packed:
        names = {name.partition("/data/")[2]: name for name in packed.namelist()}
        assert json.loads(packed.read(names["answer.json"])) == answer.json()
        said = _of(given, stage, answer.json()["stale"], _without_faults(answer.json()), *_TOLD)
        assert _says_stale(packed.read(names["report.html"]).decode()) or not said.stale
    return said


def _without_faults(answer: dict[str, Any]) -> dict[str, Any]:
    """Return an answer whose findings are those of its results: a fault's says that it is stale."""
    return answer | {"findings": [one for one in answer["findings"] if one["code"] not in _FAULTS]}


def _of(given: httpx.Response, stage: str, stale: bool | None, body: Any, *told: str) -> Said:
    """Return what an answer says by its header, which its body must not contradict; `told` are no numbers."""
    in_header = {"true": True, "false": False}[given.headers["Scancell-Stale"]]
    assert given.headers["Scancell-Verdict"] in ("pass", "warn", "fail")
    assert stale in (None, in_header)
    if isinstance(body, dict):
        body = {name: value for name, value in body.items() if name not in told}
    return Said(stage, in_header, _hash(body))


def _says_stale(text: str) -> bool:
    words = text.lower().replace("-", " ").replace("_", " ")
    return any(mark in words for mark in ("stale", "do not use", "not to be used", "changed since"))


def _hash(data: Any) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()


def assert_told(
    after: dict[str, Said], before: dict[str, Said], stale_stages: set[str], what: object = ""
) -> None:
    """Assert that exactly what rests on a stale stage says so, and that no number is another one."""
    missing = before.keys() - after.keys()
    assert not missing, (what, missing)
    for name, said in after.items():
        assert said.stale == (said.stage in stale_stages), (what, name, said)
        if said.stale and said.values:
            assert Counter(said.values) <= Counter(before[name].values), (what, name)
        elif said.numbers != "refused":
            assert said.numbers == before[name].numbers, (what, name)
