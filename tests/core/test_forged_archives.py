"""Forged archives: each field of seal and past results, and each line of the manifests, changed is named."""

import json
import zipfile
from pathlib import Path
from typing import Any

import pytest

from calib_core.archive.archive import pack, verify
from calib_core.archive.bag import open_bag, write_bag
from calib_core.archive.bag_seal import SEAL_FILE, check_seal
from calib_core.archive.folder import to_json_bytes
from calib_core.archive.seals import session_sha256, signed_result
from calib_core.errors import InputError
from calib_core.review.provenance import verify as verify_agreement
from tests.core.test_forged_results import OF_READING, leaves, other


@pytest.fixture
def result(solved_folder: Path) -> dict[str, Any]:
    return json.loads((solved_folder / "results" / "tcp.json").read_text())


@pytest.fixture(scope="module")
def archive(solved_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("forged") / "a.zip"
    pack(solved_folder, file)
    return file


def payload_of(archive: Path) -> tuple[dict[str, bytes], bytes]:
    """The files of an archive, and its seal."""
    with open_bag(archive) as bag:
        return {name: bag.read(name) for name in bag.payload}, b"".join(bag.chunks(SEAL_FILE))


def packed(out: Path, payload: dict[str, bytes], seal: bytes | None) -> Path:
    """An archive of files whose checksums are right, whatever the files are."""
    with out.open("w+b") as file:
        write_bag(file, "cell", payload, {}, lambda _: {} if seal is None else {SEAL_FILE: seal})
    return out


def test_every_field_of_an_archives_seal_changed_in_turn_is_named(archive: Path, tmp_path: Path) -> None:
    payload, seal = payload_of(archive)
    data = json.loads(seal)

    def holds() -> bool | None:
        with open_bag(packed(tmp_path / "a.zip", payload, to_json_bytes(data))) as bag:
            return check_seal(bag, {}).holds

    assert holds() is True
    for container, name in leaves(data):
        before, container[name] = container[name], other(container[name])
        assert holds() is not True, name  # None: signed by a key that nobody knows
        container[name] = before
    assert holds() is True


def test_every_line_of_a_manifest_changed_in_turn_is_refused(archive: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(archive) as source:
        files = {name: source.read(name) for name in source.namelist()}
    tried = 0
    for manifest in [name for name in files if "manifest" in name]:
        lines = files[manifest].splitlines(keepends=True)
        for k, line in enumerate(lines):
            forged = bytes([line[0] ^ 1 if line[0:1].isdigit() else ord("0")]) + line[1:]
            with zipfile.ZipFile(tmp_path / "m.zip", "w") as changed:
                for name, content in files.items():
                    changed.writestr(
                        name, b"".join([*lines[:k], forged, *lines[k + 1 :]]) if name == manifest else content
                    )
            with pytest.raises(InputError):
                verify(tmp_path / "m.zip")
            tried += 1
    assert tried > 10


def test_every_field_of_a_past_result_changed_in_turn_is_named_without_the_archives_seal(
    archive: Path, tmp_path: Path, result: dict[str, Any]
) -> None:
    payload, _ = payload_of(archive)
    session = json.loads(payload["session.json"])
    one = {
        "stage": "tcp",
        "created": result["solved"],
        "record": result,
        "solved_from": {"session": session, "files": {}},
    }
    assert session_sha256(session) == result["seal"]["session"]

    def named() -> list[Any]:
        history = to_json_bytes({"results": [one]})
        facts = verify_agreement(packed(tmp_path / "h.zip", {**payload, "history.json": history}, None))
        return [finding.values["what"] for finding in facts.findings if finding.code != "not-signed"]

    assert named() == []
    forged = [
        place
        for k, place in enumerate(leaves(result))
        if place[0] is not result or place[1] not in OF_READING
        if k % 80 == 0
    ]
    for container, name in [
        *forged,
        *list(leaves(session["cell"]))[::2],
        *list(leaves(session["captures"]))[::25],
    ]:
        before, container[name] = container[name], other(container[name])
        assert named() == ["history.json: results[0]"], name
        container[name] = before


def test_a_past_result_whose_origin_was_taken_off_is_named(
    archive: Path, tmp_path: Path, result: dict[str, Any]
) -> None:
    payload, _ = payload_of(archive)
    session, files = json.loads(payload["session.json"]), {"captures/p01.csv": "0" * 64}
    kept = signed_result(result, session, files=files, moment=result["solved"])
    origin = {"session": session, "files": files}

    def named(solved_from: object) -> list[Any]:
        one = {"stage": "tcp", "created": result["solved"], "record": kept, "solved_from": solved_from}
        history = to_json_bytes({"results": [one]})
        facts = verify_agreement(packed(tmp_path / "h.zip", {**payload, "history.json": history}, None))
        return [finding.values["what"] for finding in facts.findings if finding.code != "not-signed"]

    assert named(origin) == []
    for taken in (None, {}, {**origin, "session": {}}, {**origin, "files": {}}):
        assert named(taken) == ["history.json: results[0]"], taken
