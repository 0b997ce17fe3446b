"""Every field of what is signed, changed in turn, is named; nothing that was edited is exported unmarked."""

import copy
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from calib_core.archive.archive import pack, verify
from calib_core.archive.bag import open_bag, write_bag
from calib_core.archive.bag_seal import SEAL_FILE
from calib_core.archive.folder import load_results, load_session, to_json_bytes
from calib_core.archive.keys import keys
from calib_core.archive.seals import seal_state, signed_result, with_provenance
from calib_core.errors import ConflictError, InputError, NotFoundError
from calib_core.review.provenance import replayed
from calib_core.review.provenance import verify as verify_agreement
from server.cli import main

RELEASES = sorted((Path(__file__).parents[1] / "releases").glob("**/*.zip"))
ARCHIVES = [file for file in RELEASES if file.parent.name == "archives" or file.name == "archive.zip"]


def leaves(data: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if isinstance(data, dict):
        for name, value in data.items():
            yield from leaves(value, (*path, name))
    elif isinstance(data, list):
        for k, value in enumerate(data):
            yield from leaves(value, (*path, k))
    elif data is not None:
        yield path


def changed(data: Any, path: tuple[Any, ...]) -> Any:
    copied = copy.deepcopy(data)
    place = copied
    for name in path[:-1]:
        place = place[name]
    value = place[path[-1]]
    if isinstance(value, bool):
        other: Any = not value
    elif isinstance(value, int | float):
        other = value * 1.00001 + 0.0001
    else:
        other = f"{value}0"
    place[path[-1]] = other
    return copied


@pytest.fixture(scope="module")
def signed(solved_folder: Path) -> dict[str, Any]:
    return json.loads((solved_folder / "results" / "tcp.json").read_text())


def test_a_seal_does_not_mind_other_programs_json(signed):
    rewritten = json.loads(json.dumps({**signed, "a_newer_field": None, "empty": []}, indent=3, sort_keys=True))
    assert seal_state(rewritten) is True
    assert seal_state({**signed, "stale": False}) is True


def test_a_stripped_or_claimed_provenance_makes_nothing_better(signed):
    stripped = {name: value for name, value in signed.items() if name != "seal"}
    for claim in ("solved", "replayed", None):
        assert with_provenance({**stripped, "provenance": claim})["provenance"] == "imported"
    assert seal_state({**signed, "provenance": "replayed"}) is False


def test_replayed_folders_that_were_edited_are_refused(solved_folder, signed, tmp_path, capsys):
    """The tool moved by 50 mm and `pass` written over `warn` was exported."""
    folder = tmp_path / "cell"
    shutil.copytree(solved_folder, folder)
    file = folder / "results" / "tcp.json"
    edited = copy.deepcopy(signed)
    edited["tool0_from_laser"][0][3] += 50.0
    for forged in (edited, {name: value for name, value in edited.items() if name != "seal"}):
        file.write_bytes(to_json_bytes(forged))
        assert main(["export", str(folder), "--format", "json"]) == 1
        assert "differs from what its captures give" in capsys.readouterr().err
        assert main(["answer", str(folder), "--json"]) == 1
        assert "differs" in json.loads(capsys.readouterr().out)["faults"]
        assert main(["export", str(folder), "--format", "json", "--allow", "fail,differs"]) == 0
        assert "differs" in capsys.readouterr().out


def test_an_unsigned_result_of_another_processor_is_no_forgery(solved_folder, signed):
    session, read = load_session(solved_folder)
    other = {name: value for name, value in signed.items() if name != "seal"}
    other["covariance"] = [[x * (1 + 1e-5) for x in row] for row in other["covariance"]]
    assert replayed(session, read, {"tcp": with_provenance(other)})["tcp"]["provenance"] == "replayed"


def test_words_of_an_unsigned_result_are_those_of_its_replay(solved_folder, signed):
    session, read = load_session(solved_folder)
    other = {name: value for name, value in signed.items() if name != "seal"}
    found = replayed(session, read, {"tcp": with_provenance({**other, "warnings": [], "evidence": []})})["tcp"]
    assert (found["warnings"], found["provenance"]) == (signed["warnings"], "replayed")
    without = [finding for finding in signed["findings"] if finding["severity"] == "note"]
    hidden = with_provenance({**other, "findings": without})
    assert replayed(session, read, {"tcp": hidden})["tcp"]["provenance"] == "differs"


@pytest.fixture(scope="module")
def archive(solved_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("archive") / "a.zip"
    assert main(["archive", "pack", str(solved_folder), "--out", str(file), "--no-scene", "--quiet"]) == 0
    return file


def rewritten(archive: Path, out: Path, change: dict[str, Any], *, keep_seal: bool = True) -> Path:
    """The archive with files changed and all checksums made anew."""
    with open_bag(archive) as bag:
        payload = {name: bag.read(name) for name in bag.payload}
        seal = b"".join(bag.chunks(SEAL_FILE))
    payload |= change
    with out.open("w+b") as file:
        write_bag(file, "cell", payload, {}, lambda _: {SEAL_FILE: seal} if keep_seal else {})
    return out


def test_an_archive_is_sealed_and_every_file_is_under_the_seal(archive, tmp_path):
    facts = verify_agreement(archive)
    assert (facts.sealed, facts.findings) == (True, [])
    assert keys().own_key[:16] in facts.signed_by
    with open_bag(archive) as bag:
        names = bag.payload
    for name in names:
        with open_bag(archive) as bag:
            content = bag.read(name)
        if name.endswith(".json"):
            data = json.loads(content)
            forged = [
                to_json_bytes(changed(data, path)) for path in list(leaves(data))[:: 1 + len(content) // 600]
            ]
        else:
            forged = [content + b"\n"]
        for k, other in enumerate(forged):
            try:
                found = verify(rewritten(archive, tmp_path / f"{k}.zip", {name: other}))
            except InputError:
                continue  # no session or result any more
            assert found.sealed is False, (name, k)
            assert [finding.values["what"] for finding in found.findings] == [name]


def test_names_may_be_taken_out_and_the_seal_may_be_missing(archive, tmp_path):
    with open_bag(archive) as bag:
        session = json.loads(bag.read("session.json"))
    named = to_json_bytes({**session, "documentation": {"operator": "A. B."}})
    assert verify(rewritten(archive, tmp_path / "n.zip", {"session.json": named})).sealed is True
    bare = verify(rewritten(archive, tmp_path / "b.zip", {}, keep_seal=False))
    assert (bare.sealed, [finding.code for finding in bare.findings]) == (None, ["not-signed"])


def test_without_a_seal_answer_and_report_are_compared_with_the_results(archive, tmp_path):
    with open_bag(archive) as bag:
        answer, report = json.loads(bag.read("answer.json")), bag.read("report.html").decode()
    whole = re.escape(str(int(answer["tool0_from_laser"]["numbers"][0])))
    forged, count = re.subn(rf"(?<![\d.]){whole}\.\d+", "11.11", report)
    assert count
    answer["tool0_from_laser"]["matrix"][0][3] += 1.0
    change = {"answer.json": to_json_bytes(answer), "report.html": forged.encode()}
    found = verify_agreement(rewritten(archive, tmp_path / "a.zip", change, keep_seal=False))
    told = {
        finding.values["what"]: finding.values["fields"]
        for finding in found.findings
        if finding.severity == "error"
    }
    assert told == {"answer.json": "tool0_from_laser", "report.html": "tool0_from_laser"}


@pytest.mark.parametrize("file", ARCHIVES, ids=lambda file: file.stem)
def test_archives_of_earlier_releases_are_not_accused(file):
    facts = verify_agreement(file)
    assert (facts.sealed, [finding.code for finding in facts.findings]) == (None, ["not-signed"])


def test_a_key_is_renewed_dated_and_removed(signed, solved_folder, tmp_path, monkeypatch, capsys):
    session = load_session(solved_folder)[0]
    monkeypatch.setenv("SCANCELL_KEY_FILE", str(tmp_path / "config" / "key.pem"))
    assert seal_state(signed) is None
    old, former = keys().own_key, signed_result(signed, session)
    assert (tmp_path / "config" / "key.pem").stat().st_mode & 0o077 == 0
    assert main(["trust", "renew"]) == 0
    assert keys().own_key != old
    assert seal_state(former) is True
    with pytest.raises(ConflictError):
        main(["trust", "remove", keys().own_key, "--debug"])
    assert main(["trust", "date", old[:12], "--until", "2020-01-01"]) == 0
    assert seal_state(former) is None
    assert main(["trust", "date", old[:12]]) == 0
    assert seal_state(former) is True
    assert main(["trust", "remove", old[:12]]) == 0
    assert seal_state(former) is None
    with pytest.raises(NotFoundError):
        main(["trust", "remove", old[:12], "--debug"])
    assert main(["trust", "add", signed["seal"]["key"], "--name", "laptop"]) == 0
    assert seal_state(signed) is True
    capsys.readouterr()
    assert main(["trust", "--json"]) == 0
    assert {one["name"] for one in json.loads(capsys.readouterr().out)["trusted"]} >= {"laptop"}


def test_a_home_that_cannot_be_written_signs_for_as_long_as_the_process_lives(signed, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("SCANCELL_KEY_FILE", str(tmp_path / "file" / "key.pem"))
    assert "cannot be written" in keys().trouble
    assert seal_state(signed_result(signed, {})) is True


def test_packing_needs_no_key(solved_folder, tmp_path):
    assert pack(solved_folder, tmp_path / "a.zip").sealed is True
    assert set(load_results(solved_folder)) == {"tcp"}
