"""Ways to a wrong release, each tried: it must be refused, or the answer must say what is wrong with it."""

import json
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from functools import cached_property
from io import BytesIO, TextIOWrapper
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import httpx

from server.cli import main
from tests.server.access import bearer, guarded
from tests.server.live_server import upload
from tests.verified import shifted, verified_session, written

_SHIFTED_MM = 1.0
_ZIP = {"Content-Type": "application/zip"}


@dataclass(frozen=True)
class World:
    """A server with logins, and a folder to work in."""

    client: httpx.Client
    tokens: Mapping[str, str]
    folder: Path

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
    def failed_folder(self) -> Path:
        """The same as a folder."""
        return written(verified_session(3, _SHIFTED_MM), self.folder / "failed")

    @cached_property
    def right_folder(self) -> Path:
        """A right cell as a folder, solved here."""
        return written(verified_session(3), self.folder / "right")


@contextmanager
def world(folder: Path) -> Generator[World]:
    """Serve until all was tried; the client is the administrator's."""
    with guarded(folder / "data") as (client, tokens):
        client.headers.update(bearer(tokens["admin"]))
        yield World(client, tokens, folder)


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


def export_of_it_by_the_command_line(here: World) -> str:
    status, said = command("export", str(here.failed_folder), "--format", "kuka")
    assert status == 1, said
    assert "verification failed" in said, said
    return f"refused: {said}"


def its_answer_by_the_command_line(here: World) -> str:
    status, said = command("answer", str(here.failed_folder), "--json")
    assert status == 1
    assert json.loads(said)["faults"] == ["verify-fail"]
    return "refused with exit status 1, faults verify-fail"


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
    return _refused(here.release(second), "drift")


def drift_acknowledged_by_the_nights_program(here: World) -> str:
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
    answer = here.client.post("/archives", content=content.getvalue(), headers=_ZIP)
    return _refused(answer)


def a_folder_whose_result_was_edited(here: World) -> str:
    folder = written(verified_session(19), here.folder / "edited")
    result = folder / "results" / "tcp.json"
    result.write_bytes(_moved(result.read_bytes()))
    status, said = command("export", str(folder), "--format", "kuka")
    assert status == 1, said
    return f"refused: {said}"


def _moved(result: bytes) -> bytes:
    record = json.loads(result)
    record["tool0_from_laser"][0][3] += 50.0
    return json.dumps(record).encode()


WAYS: tuple[Callable[[World], str], ...] = (
    release_of_a_failed_verification,
    export_of_a_failed_verification,
    export_of_it_by_the_command_line,
    its_answer_by_the_command_line,
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
"""All of them, by page (which asks by REST), REST and command line."""
