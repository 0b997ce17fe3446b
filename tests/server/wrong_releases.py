"""Ways to a wrong release, each tried: it must be refused, or the answer must say what is wrong with it.

`WAYS` are tried by REST, `BY_COMMAND` by the command line; `tests/web/test_wrong_releases_page.py` tries the page.
"""

import json
import os
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field, replace
from functools import cached_property
from io import BytesIO, TextIOWrapper
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import httpx

from server.cli import main
from tests.server.access import bearer, guarded, site_of
from tests.server.live_server import upload
from tests.verified import shifted, verified_session, written

_SHIFTED_MM = 1.0
_ZIP = {"Content-Type": "application/zip"}
_TOKEN = "SCANCELL_TOKEN"


@dataclass(frozen=True)
class World:
    """A server with logins, and a folder to work in."""

    client: httpx.Client
    tokens: Mapping[str, str]
    folder: Path
    paths: dict[str, str] = field(default_factory=dict[str, str])
    """The newest session of each cell."""

    def session(self, cell: str, made: Any, changes: Mapping[str, Any] | None = None, stage: str = "all") -> str:
        """Return a session of a cell as a program sends it, solved; its path."""
        record = made.session.to_json()
        captures = record.pop("captures")
        record["cell"] |= {"id": cell, **(changes or {})}
        here = f"/sessions/{self.client.post('/sessions', json=record).raise_for_status().json()['id']}"
        for capture in captures:
            upload(
                self.client, here.rpartition("/")[2], capture, *(made.files[name] for name in capture["files"])
            ).raise_for_status()
        self.solve(here, stage)
        self.paths[cell] = here
        return here

    def solve(self, here: str, stage: str) -> None:
        """Solve and wait."""
        job = self.client.post(f"{here}/solve/{stage}", params={"wait": 120}).raise_for_status().json()
        assert job.get("status", "done") == "done", job

    def release(self, here: str, role: str = "admin", **body: str) -> httpx.Response:
        """Ask for a release."""
        return self.client.post(f"{here}/release", json=body, headers=bearer(self.tokens[role]))

    def answer(self, here: str) -> dict[str, Any]:
        """Return the session's answer."""
        return self.client.get(f"{here}/answer").raise_for_status().json()

    @cached_property
    def failed(self) -> str:
        """A cell whose scanner was shifted after it was calibrated."""
        return self.session("failed", verified_session(3, _SHIFTED_MM))

    @cached_property
    def right_folder(self) -> Path:
        """A right cell as a folder, solved here."""
        return written(verified_session(3), self.folder / "right")


@contextmanager
def world(folder: Path) -> Generator[World]:
    """Serve until all was tried; the client is the administrator's."""
    with guarded(folder / "data") as (client, tokens):
        client.headers.update(bearer(tokens["admin"]))
        before = os.environ.get(_TOKEN)
        os.environ[_TOKEN] = tokens["admin"]
        try:
            yield World(client, tokens, folder)
        finally:
            os.environ.pop(_TOKEN) if before is None else os.environ.update({_TOKEN: before})


def _refused(answer: httpx.Response, *words: str) -> str:
    assert answer.status_code in (403, 409, 422), answer.text
    detail = answer.json()["detail"]
    assert all(word in detail for word in words), detail
    return f"refused: {detail}"


def command(*words: str) -> tuple[int, str]:
    said = TextIOWrapper(BytesIO(), "utf-8", write_through=True)
    with redirect_stdout(said), redirect_stderr(said):
        status = main([*words])
    said.seek(0)
    return status, said.read()


def release_of_a_failed_verification(here: World) -> str:
    return _refused(here.release(here.failed), "verify-fail")


def export_of_a_failed_verification(here: World) -> str:
    return _refused(here.client.get(f"{here.failed}/exports/kuka"), "verify-fail")


def its_answer_taken_by_a_program(here: World) -> str:
    answer = here.client.get(f"{here.failed}/answer").raise_for_status()
    assert answer.headers["Scancell-Faults"] == "verify-fail"
    assert answer.json()["faults"] == ["verify-fail"]
    return "marked: faults verify-fail"


def rollback_to_it(here: World) -> str:
    made = here.session("rolled", verified_session(3, _SHIFTED_MM))
    released = here.release(made, allow="verify-fail").raise_for_status().json()
    assert here.client.get("/cells/rolled/answer").headers["Scancell-Faults"] == "verify-fail"
    return _refused(here.client.post("/cells/rolled/rollback", json={"number": released["number"]}), "verify-fail")


def a_capture_left_out_after_the_decision(here: World) -> str:
    made = here.session("picked", verified_session(4, _SHIFTED_MM))
    last = here.client.get(f"{made}/captures", params={"limit": 200}).json()["items"][-1]["id"]
    here.client.patch(f"{made}/captures/{last}", json={"excluded": True}).raise_for_status()
    here.solve(made, "verify")
    (told,) = here.answer(made)["decided_before"]
    assert told["left_out"][0]["capture"] == last
    return f"marked: decided before: {told['decision']}, left out {last}"


def a_limit_widened_after_the_decision(here: World) -> str:
    made = here.session("widened", verified_session(5, _SHIFTED_MM))
    here.client.patch(made, json={"cell": {"verification": {"tool_mm": 5.0}}}).raise_for_status()
    here.solve(made, "verify")
    (change,) = here.answer(made)["limits_changed"]
    assert "0.4" in change
    return f"marked: {change}"


def a_limit_taken_away_after_the_decision(here: World) -> str:
    made = here.session("unlimited", verified_session(6, _SHIFTED_MM))
    here.client.patch(made, json={"cell": {"verification": {"tool_mm": None}}}).raise_for_status()
    refused = _refused(here.release(made), "verify-fail")
    here.solve(made, "verify")
    changed = here.answer(made)["limits_changed"]
    assert changed, "the answer must tell that the limit was taken away"
    return refused


def the_verification_deleted(here: World) -> str:
    made = here.session("deleted", verified_session(7, _SHIFTED_MM))
    items = here.client.get(f"{made}/captures", params={"limit": 200}).json()["items"]
    for one in items:
        if one["step"] == "verify":
            here.client.delete(f"{made}/captures/{one['id']}").raise_for_status()
    return _refused(here.release(made), "verify-fail")


def a_stale_answer(here: World) -> str:
    made = here.session("stale", verified_session(8), stage="tcp")
    here.client.patch(f"{made}/captures/p03", json={"excluded": True}).raise_for_status()
    _refused(here.client.get(f"{made}/exports/abb"), "stale")
    return _refused(here.release(made), "stale")


def an_answer_that_failed(here: World) -> str:
    made = verified_session(9)
    captures = [
        shifted(made.session, c, [60.0 * (k % 3), 0, 0], "tcp") for k, c in enumerate(made.session.captures)
    ]
    wrong = replace(made, session=made.session.model_copy(update={"captures": captures}))
    path = here.session("wrong", wrong, stage="tcp")
    assert here.answer(path)["verdict"] == "fail"
    return _refused(here.release(path), "fail")


def captures_that_calibrated_verify(here: World) -> str:
    made = verified_session(10)
    own = [c for c in made.session.captures if c.step == "tcp"]
    copies = [c.model_copy(update={"id": f"w{k}", "step": "verify"}) for k, c in enumerate(own[:8])]
    copied = replace(made, session=made.session.model_copy(update={"captures": [*own, *copies]}))
    here.client.put("/cells/copied/policy", json={"needs": ["verify"]}).raise_for_status()
    path = here.session("copied", copied)
    assert here.answer(path)["decision"] == "undecided"
    return _refused(here.release(path), "verification")


def two_captures_verify(here: World) -> str:
    here.client.put("/cells/few/policy", json={"needs": ["verify"]}).raise_for_status()
    path = here.session("few", verified_session(11, of_sphere=2, limits={"tool_mm": 2.0}))
    assert here.answer(path)["decision"] == "undecided"
    return _refused(here.release(path), "verification")


def no_verification_where_the_policy_needs_one(here: World) -> str:
    here.client.put("/cells/unverified/policy", json={"needs": ["verify"]}).raise_for_status()
    return _refused(here.release(here.session("unverified", verified_session(12), stage="tcp")), "verification")


def one_wrong_pose_among_those_that_verify(here: World) -> str:
    made = verified_session(13)
    wrong = made.session.captures[-3]
    captures = [shifted(made.session, c, [3.0, 4.0, 0.0]) if c is wrong else c for c in made.session.captures]
    path = here.session("one", replace(made, session=made.session.model_copy(update={"captures": captures})))
    result = here.client.get(f"{path}/results/verify").json()
    (said,) = (one for one in result["findings"] if one["code"] == "verify-captures-disagree")
    assert said["captures"] == [wrong.id]
    assert result["verdict"] != "pass"
    return f"marked: {said['text']}"


def a_tool_that_was_bumped(here: World) -> str:
    first = here.session("bumped", verified_session(14), stage="tcp")
    here.release(first).raise_for_status()
    made = verified_session(14)
    captures = [shifted(made.session, c, [_SHIFTED_MM, 0, 0], "tcp") for c in made.session.captures]
    second = here.session("bumped", replace(made, session=made.session.model_copy(update={"captures": captures})))
    assert here.client.get("/cells/bumped/answer").headers["Scancell-Faults"] == "drift"
    # Nor is the flag taken away: with the session, by another cell, or by a capture left out.
    _refused(here.client.delete(second), "acknowledge")
    _refused(here.client.patch(second, json={"cell": {"id": "elsewhere"}}), "acknowledge")
    here.client.patch(f"{second}/captures/p03", json={"excluded": True}).raise_for_status()
    assert here.client.get("/cells/bumped/answer").headers["Scancell-Faults"] == "drift"
    here.client.patch(f"{second}/captures/p03", json={"excluded": False}).raise_for_status()
    return _refused(here.release(second), "drift")


def drift_acknowledged_by_the_nights_program(here: World) -> str:
    if "bumped" not in here.paths:  # tests run alone, too
        a_tool_that_was_bumped(here)
    asked = here.client.post(
        "/cells/bumped/acknowledge", json={"fault": "drift"}, headers=bearer(here.tokens["capture"])
    )
    return _refused(asked, "release")


def another_scanner(here: World) -> str:
    equipment = [{"kind": "scanner", "serial": "S-1"}]
    first = here.session("replaced", verified_session(15), {"equipment": equipment}, "tcp")
    here.release(first).raise_for_status()
    equipment = [{"kind": "scanner", "serial": "S-2"}]
    second = here.session("replaced", verified_session(15), {"equipment": equipment}, "tcp")
    return _refused(here.release(second), "equipment-changed")


def an_answer_that_is_overdue(here: World) -> str:
    here.client.put("/cells/late/policy", json={"interval_days": 1e-7}).raise_for_status()
    return _refused(here.release(here.session("late", verified_session(16), stage="tcp")), "overdue")


def released_by_who_captured(here: World) -> str:
    here.client.put("/cells/eyes/policy", json={"four_eyes": True}).raise_for_status()
    return _refused(here.release(here.session("eyes", verified_session(17), stage="tcp")), "four eyes")


def a_release_with_the_token_of_capturing(here: World) -> str:
    return _refused(here.release(here.failed, "capture", allow="verify-fail"), "release")


def a_policy_set_by_who_releases(here: World) -> str:
    asked = here.client.put("/cells/eyes/policy", json={}, headers=bearer(here.tokens["release"]))
    return _refused(asked, "admin")


def evidence_in_force_deleted(here: World) -> str:
    path = here.session("kept", verified_session(18), stage="tcp")
    here.release(path).raise_for_status()
    _refused(here.client.patch(path, json={"cell": {"id": "elsewhere"}}), "in force")
    _refused(here.client.delete(f"{path}/captures/p03"), "in force")
    return _refused(here.client.delete(path), "in force")


def an_allow_that_names_everything(here: World) -> str:
    return _refused(here.release(here.failed, allow="all"), "verify-fail")


def an_archive_whose_result_was_edited(here: World) -> str:
    packed = here.folder / "right.zip"
    status, said = command("archive", "pack", str(here.right_folder), "--no-scene", "--out", str(packed))
    assert status == 0, said
    content = BytesIO()
    with ZipFile(packed) as before, ZipFile(content, "w") as after:
        for name in before.namelist():
            data = before.read(name)
            after.writestr(name, _moved(data) if name.endswith("data/results/tcp.json") else data)
    (here.folder / "edited.zip").write_bytes(content.getvalue())
    answer = here.client.post("/archives", content=content.getvalue(), headers=_ZIP)
    return _refused(answer)


def a_folder_whose_result_was_edited(here: World) -> str:
    folder = written(verified_session(19), here.folder / "edited")
    result = folder / "results" / "tcp.json"
    result.write_bytes(_moved(result.read_bytes()))
    packed = here.folder / "edited-folder.zip"
    status, said = command("archive", "pack", str(folder), "--no-scene", "--out", str(packed))
    assert status == 0, said
    # Nobody signed it, as what other machines solved: it counts once its captures gave the same here.
    answer = here.client.post("/archives", content=packed.read_bytes(), headers=_ZIP)
    return _refused(here.release(f"/sessions/{answer.raise_for_status().json()['id']}"))


def _moved(result: bytes) -> bytes:
    record = json.loads(result)
    record["tool0_from_laser"][0][3] += 50.0
    return json.dumps(record).encode()


WAYS: tuple[Callable[[World], str], ...] = (
    release_of_a_failed_verification,
    export_of_a_failed_verification,
    its_answer_taken_by_a_program,
    rollback_to_it,
    a_capture_left_out_after_the_decision,
    a_limit_widened_after_the_decision,
    a_limit_taken_away_after_the_decision,
    the_verification_deleted,
    a_stale_answer,
    an_answer_that_failed,
    captures_that_calibrated_verify,
    two_captures_verify,
    no_verification_where_the_policy_needs_one,
    one_wrong_pose_among_those_that_verify,
    a_tool_that_was_bumped,
    drift_acknowledged_by_the_nights_program,
    another_scanner,
    an_answer_that_is_overdue,
    released_by_who_captured,
    a_release_with_the_token_of_capturing,
    a_policy_set_by_who_releases,
    evidence_in_force_deleted,
    an_allow_that_names_everything,
    an_archive_whose_result_was_edited,
    a_folder_whose_result_was_edited,
)
"""All of them, by REST."""


def _folder(here: World, cell: str, made: Any, change: Callable[[dict[str, Any]], object]) -> Path:
    """Return a folder of a session that was solved, then changed by hand and solved again."""
    folder = written(made, here.folder / cell)
    file = folder / "session.json"
    record = json.loads(file.read_bytes())
    change(record)
    file.write_text(json.dumps(record))
    command("run", str(folder), "--quiet")
    return folder


def _faulty(*session: str, fault: str) -> str:
    """Ask for an answer and an export; both must tell the fault."""
    status, said = command("answer", *session, "--json")
    assert status == 1, said
    assert fault in json.loads(said[said.index("{") :])["faults"], said
    status, said = command("export", *session, "--format", "kuka")
    assert status == 1 or "ATTENTION" in said, said
    return f"refused: {fault}" if status else f"marked: {fault}"


def _decided_before(folder: Path, *words: str) -> str:
    """Ask for answer, export and report, folder and archive alike: each must tell what was decided before."""
    packed = folder.with_suffix(".zip")
    command("archive", "pack", str(folder), "--no-scene", "--out", str(packed))
    for session in (folder, packed):
        said = "".join(
            command(name, str(session), *more)[1]
            for name, *more in (("answer",), ("export", "--format", "json"), ("report", "--out", "-"))
        )
        for word in ("was: failed", *words):
            assert said.count(word) >= 3, said
    return f"marked: {words}"


def _there(cell: str, fault: str) -> Callable[[World], str]:
    """Return the way by the command line that asks the server for a session which its way by REST has made."""
    return lambda here: _faulty(here.paths[cell].rpartition("/")[2], "--server", site_of(here.client), fault=fault)


def _left_out(record: dict[str, Any]) -> None:
    record["captures"][-1]["excluded"] = True


def _without_verification(record: dict[str, Any]) -> None:
    record["captures"] = [one for one in record["captures"] if one["step"] != "verify"]


def _edited(name: str) -> Callable[[World], str]:
    return lambda here: _refused_by_command("export", str(here.folder / name), "--format", "kuka")


def _of_wrong_pose(here: World) -> str:
    status, said = command("run", here.paths["one"].rpartition("/")[2], "--server", site_of(here.client))
    assert status == 0, said
    (wrong,) = here.client.get(f"{here.paths['one']}/results/verify").json()["findings"][:1]
    assert wrong["text"] in " ".join(said.split()), said
    return f"marked: {said}"


def _removed_by_retention(here: World) -> str:
    status, said = command(
        "retention", "--server", site_of(here.client), "--cell", "kept", "--quota-mb", "0.001", "--remove"
    )
    assert status == 0, said
    here.client.get(here.paths["kept"]).raise_for_status()
    return f"refused: {said}"


BY_COMMAND: Mapping[Callable[[World], str], Callable[[World], str]] = {
    release_of_a_failed_verification: _there("failed", "verify-fail"),
    export_of_a_failed_verification: _there("failed", "verify-fail"),
    its_answer_taken_by_a_program: _there("failed", "verify-fail"),
    rollback_to_it: _there("rolled", "verify-fail"),
    a_capture_left_out_after_the_decision: lambda here: _decided_before(
        _folder(here, "picked", verified_session(4, _SHIFTED_MM), _left_out), "left out"
    ),
    a_limit_widened_after_the_decision: lambda here: _decided_before(
        _folder(here, "widened", verified_session(5, _SHIFTED_MM),
                lambda record: record["cell"]["verification"].update(tool_mm=5.0)),
        "limits were changed",
    ),
    a_limit_taken_away_after_the_decision: lambda here: _decided_before(
        _folder(here, "unlimited", verified_session(6, _SHIFTED_MM),
                lambda record: record["cell"].update(verification={})),
        "limits were changed",
    ),
    the_verification_deleted: lambda here: _faulty(
        str(_folder(here, "deleted", verified_session(7, _SHIFTED_MM), _without_verification)), fault="verify-fail"
    ),
    a_stale_answer: _there("stale", "stale"),
    an_answer_that_failed: _there("wrong", "fail"),
    captures_that_calibrated_verify: _there("copied", "verify-undecided"),
    two_captures_verify: _there("few", "verify-undecided"),
    no_verification_where_the_policy_needs_one: _there("unverified", "verify-undecided"),
    one_wrong_pose_among_those_that_verify: _of_wrong_pose,
    a_tool_that_was_bumped: _there("bumped", "drift"),
    drift_acknowledged_by_the_nights_program: _there("bumped", "drift"),
    another_scanner: _there("replaced", "equipment-changed"),
    an_answer_that_is_overdue: _there("late", "overdue"),
    evidence_in_force_deleted: _removed_by_retention,
    an_allow_that_names_everything: lambda here: _refused_by_command(
        "export", here.paths["failed"].rpartition("/")[2], "--server", site_of(here.client), "--format", "kuka",
        "--allow", "all",
    ),
    an_archive_whose_result_was_edited: _edited("edited.zip"),
    a_folder_whose_result_was_edited: _edited("edited"),
}  # fmt: skip
"""By the command line, after the same way by REST.

The others are of logins and policies: it has no words to put in force, to acknowledge or to set a policy.
"""


def _refused_by_command(*words: str) -> str:
    status, said = command(*words)
    assert status != 0, said
    return f"refused: {said}"
