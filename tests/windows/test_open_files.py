"""Files that are open are neither renamed nor removed, and one that is held for a moment is tried again."""

import ast
import shutil
import time
from pathlib import Path
from typing import Any

import pytest

from calib_core import disk
from calib_core.archive.archive import pack, unpack
from calib_core.errors import InputError
from calib_core.formats.shared.writing import write_atomically, write_pieces
from server.store.blob_folder import FolderBlobs
from server.store.devices import DeviceSecrets

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="open files are not told here")


def test_an_open_file_is_neither_renamed_replaced_nor_removed_here(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    two.write_bytes(b"")
    with one.open("wb"):
        for change in (lambda: one.rename(tmp_path / "three"), lambda: one.replace(two), one.unlink):
            with pytest.raises(PermissionError):
                change()
        with pytest.raises(PermissionError):
            two.replace(one)
        with pytest.raises(PermissionError):
            tmp_path.rename(tmp_path.with_name("other"))
    one.rename(two)


def test_blobs_are_stored_one_by_one_in_pieces_and_together(tmp_path: Path) -> None:
    blobs = FolderBlobs(tmp_path)
    assert blobs.read(blobs.put(b"one")) == b"one"
    assert [blobs.read(d) for d in blobs.put_all([b"two", b"three", b"two"])] == [b"two", b"three", b"two"]
    digest, size = blobs.put_pieces(iter([b"fo", b"ur"]))
    assert (blobs.read(digest), size) == (b"four", 4)
    assert blobs.read(blobs.mend(b"one")) == b"one"
    blobs.remove([digest], young_s=-1)
    assert blobs.damage(digest) == "missing from the store"
    assert blobs.interrupted() == []


def test_files_archives_and_secrets_are_written(solved_folder: Path, tmp_path: Path) -> None:
    for _ in range(2):
        write_atomically(tmp_path / "a", b"a")
        write_pieces(tmp_path / "b", [b"b" * 3_000_000])
        pack(solved_folder, tmp_path / "c.zip")
        DeviceSecrets(tmp_path).put("cell", "scanner", {"password": "p"})
    unpack(tmp_path / "c.zip", tmp_path / "unpacked")
    assert (tmp_path / "unpacked" / "data" / "session.json").is_file()


def test_what_a_scanner_holds_for_a_moment_is_tried_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    waited: list[float] = []
    target = tmp_path / "target"
    held = target.open("wb")

    def let_go(pause_s: float) -> None:
        waited.append(pause_s)
        if len(waited) == 3:
            held.close()

    monkeypatch.setattr(time, "sleep", let_go)
    write_atomically(target, b"new")
    assert target.read_bytes() == b"new"
    assert waited == sorted(waited)
    assert len(waited) == 3


def test_what_is_held_for_good_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    waited: list[float] = []
    monkeypatch.setattr(time, "sleep", waited.append)
    target = tmp_path / "target"
    with target.open("wb"), pytest.raises(InputError, match="a place to write to"):
        write_atomically(target, b"new")
    assert 1 < sum(waited) < 5
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize(("held_for", "is_left"), [(2, False), (99, True)])
def test_a_temporary_folder_that_a_scanner_holds_spoils_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, held_for: int, is_left: bool
) -> None:
    remove, tried = shutil.rmtree, list[Path]()

    def held(folder: Path, onerror: Any) -> None:
        tried.append(folder)
        if len(tried) <= held_for:
            error = PermissionError(13, "held", str(folder))
            error.winerror = 32  # type: ignore[attr-defined]
            raise error
        remove(folder, onerror=onerror)

    monkeypatch.setattr(shutil, "rmtree", held)
    monkeypatch.setattr(time, "sleep", lambda _: None)
    with disk.temporary_folder(within=tmp_path) as folder:
        (folder / "page.html").write_text("done", encoding="utf-8")
    assert folder.exists() == is_left
    assert len(tried) > 2


def test_other_errors_are_told_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "sleep", lambda _: pytest.fail("waited for what does not pass"))
    with pytest.raises(FileNotFoundError):
        disk.replace_file(tmp_path / "none", tmp_path / "target")
    with pytest.raises(FileNotFoundError):
        disk.remove_folder(tmp_path / "none")


def changing(file: Path) -> list[str]:
    """Return the calls of a file that rename or remove: of paths, of `os`, of `shutil`."""
    found: list[str] = []
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
            continue
        of = node.func.value.id if isinstance(node.func.value, ast.Name) else ""
        name = node.func.attr
        path_replaced = name == "replace" and len(node.args) == 1 and not node.keywords  # a text's has two
        of_module = of in ("os", "shutil") and name in ("replace", "rename", "remove", "unlink", "rmtree", "move")
        # Those of Python end with an error where a scanner holds a file: after all was done.
        forgives = any(one.arg == "ignore_cleanup_errors" for one in node.keywords)
        folder_removed = name == "TemporaryDirectory" and not forgives
        if name in ("unlink", "rename") or path_replaced or of_module or folder_removed:
            found.append(f"{file.relative_to(ROOT)}:{node.lineno}: {of}.{name}")
    return found


def test_all_that_renames_and_removes_tries_again() -> None:
    files = [file for top in ("calib_core", "server") for file in (ROOT / top).rglob("*.py")]
    helper = ROOT / "calib_core" / "disk.py"
    assert len(changing(helper)) == 4
    assert [line for file in files if file != helper for line in changing(file)] == []
