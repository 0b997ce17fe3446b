"""Every field of what is signed, changed in turn, is named; nothing that was edited is exported unmarked."""

import copy
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from calib_core.archive.archive import pack, read_archive, verify
from calib_core.archive.bag import open_bag, write_bag
from calib_core.archive.bag_seal import SEAL_FILE
from calib_core.archive.folder import load_results, load_session, to_json_bytes
from calib_core.archive.keys import keys
from calib_core.archive.seals import seal_state, signed_result, with_provenance
from calib_core.errors import ConflictError, InputError, NotFoundError
from calib_core.evidence.text import verdict_words
from calib_core.exports.answer import answer_of
from calib_core.findings.catalogues import LANGUAGES, catalogue
from calib_core.records import Session
from calib_core.review.answer import answer_record
from calib_core.review.printed import misprinted
from calib_core.review.provenance import answer_fields, replayed
from calib_core.review.provenance import verify as verify_agreement
from server.cli import main
from server.render.report.first_page import Circumstances
from server.render.report.report import report_html

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


@pytest.mark.thorough
def test_replayed_folders_that_were_edited_are_refused(solved_folder, signed, tmp_path, capsys):
    """The tool moved by 50 mm and `pass` written over `warn` was exported."""
    folder = tmp_path / "cell"
    shutil.copytree(solved_folder, folder)
    file = folder / "results" / "tcp.json"
    edited = copy.deepcopy(signed)
    edited["tool0_from_laser"][0][3] += 50.0
    bare = {name: value for name, value in edited.items() if name != "seal"}
    for forged in (edited, bare, {**bare, "method_revision": 99}, {**bare, "method_revision": 1}):
        file.write_bytes(to_json_bytes(forged))
        assert main(["export", str(folder), "--format", "json"]) == 1
        assert "differs from what its captures give" in capsys.readouterr().err
        assert main(["answer", str(folder), "--json"]) == 1
        assert "differs" in json.loads(capsys.readouterr().out)["faults"]
        assert main(["export", str(folder), "--format", "json", "--allow", "fail,differs"]) == 0
        assert "differs" in capsys.readouterr().out
    file.write_bytes(to_json_bytes(edited))
    assert main(["answer", str(folder), "--lang", "de"]) == 1
    told = " ".join(capsys.readouterr().out.split())
    assert "neu berechnet ergibt es hier andere Zahlen" in told
    assert "ist nicht das, was signiert wurde" in told
    assert "Gescheitert" not in told  # nor in English: the verdict is the result's own


def test_an_unsigned_result_of_another_processor_is_no_forgery(solved_folder, signed):
    session, read = load_session(solved_folder)
    other = {name: value for name, value in signed.items() if name != "seal"}
    other["covariance"] = [[x * (1 + 1e-5) for x in row] for row in other["covariance"]]
    assert replayed(session, read, {"tcp": with_provenance(other)})["tcp"]["provenance"] == "replayed"


@pytest.mark.thorough
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
        seal = b"".join(bag.chunks(SEAL_FILE)) if keep_seal else b""
    payload |= change
    with out.open("w+b") as file:
        write_bag(file, "cell", payload, {}, lambda _: {SEAL_FILE: seal} if keep_seal else {})
    return out


@pytest.mark.thorough
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


def disagreeing(archive: Path) -> dict[str, str]:
    """Return which files of an archive do not agree with its results, and in which fields."""
    found = verify_agreement(archive).findings
    return {str(one.values["what"]): str(one.values["fields"]) for one in found if one.code == "archive-disagrees"}


def parts(archive: Path) -> tuple[Session, dict[str, Any], dict[str, Any], str]:
    """Return an archive's session, results, answer and report."""
    with open_bag(archive) as bag:
        archived = read_archive(bag)
        report = bag.read("report.html").decode() if "report.html" in bag.payload else ""
        return archived.session, archived.results, json.loads(bag.read("answer.json")), report


WHOLE = [file for file in ARCHIVES if file.stem in ("tcp", "turntable", "verify")]


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("file", WHOLE, ids=lambda file: file.stem)
def test_without_a_seal_every_field_of_the_answer_is_compared_with_the_results(file, tmp_path):
    session, results, told, _ = parts(file)
    own = answer_record(answer_of(session, results)).to_json()
    for path in leaves(told):
        forged = changed(told, path)
        if path != ("solved",):  # results of then do not tell when they were solved
            assert answer_fields(to_json_bytes(forged), own), path
    forged = changed(told, ("tool0_from_laser", "matrix", 0, 1))
    assert disagreeing(
        rewritten(file, tmp_path / "a.zip", {"answer.json": to_json_bytes(forged)}, keep_seal=False)
    ) == {"answer.json": "tool0_from_laser"}


def test_an_answer_of_another_processor_is_not_accused(archive):
    session, results, told, _ = parts(archive)
    own = answer_record(answer_of(session, results)).to_json()
    frame = told["tool0_from_laser"]
    frame["covariance"] = [[x * (1 + 1e-5) for x in row] for row in frame["covariance"]]
    told["position_sigma_mm"] *= 1 + 5e-6
    assert not answer_fields(to_json_bytes(told), own)
    emptied = {**told, "tool0_from_laser": {}, "verdict": None}
    assert answer_fields(to_json_bytes(emptied), own) == ["verdict", "tool0_from_laser"]


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("file", WHOLE, ids=lambda file: file.stem)
def test_without_a_seal_what_the_report_prints_is_compared_with_the_results(file, language):
    """Each number of its answer, tables and figures, its verdicts, decisions and name; one language a number."""
    session, results, told, _ = parts(file)
    report = report_html(session, results, circumstances=Circumstances(language=catalogue(language)))

    def named(page: str) -> list[str]:
        return list(misprinted(page.encode(), session, results, told))

    assert named(report) == []
    shown = re.compile(r"<td[^>]*>(?:[−\d.,]+ )?(?:± )?[−\d.,]*\d(?=(?:[\u202f°][^<]*)?</td>)")
    begins = report.index('class="verdict', report.index('class="verdict', report.index("<body")) + 20)
    numbers = [match.end() for match in shown.finditer(report, begins)]
    assert len(numbers) > 50
    for end in numbers[LANGUAGES.index(language) :: 3 * (1 + len(numbers) // 100)]:
        other = "7" if report[end - 1] != "7" else "8"
        assert named(report[: end - 1] + other + report[end:]), report[end - 60 : end + 20]
    word, other = (verdict_words(verdict, catalogue(language))[0] for verdict in ("pass", "fail"))
    for forged in (f'"verdict pass">{other}<', f'"verdict fail">{word}<', f'"verdict fail">{other}<'):
        assert "verdict" in named(report.replace(f'"verdict pass">{word}<', forged, 1))
    assert "session" in named(report.replace(f"<h1>{session.name}", "<h1>another"))
    if 'class="decided pass"' in report:
        assert "decision" in named(report.replace('class="decided pass"', 'class="decided fail"', 1))
    begins = report.index("±", report.index('<p class="answer">'))
    assert named(report[:begins] + re.sub(r"0([.,])", r"7\1", report[begins:], count=1)) == ["figures"]


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
