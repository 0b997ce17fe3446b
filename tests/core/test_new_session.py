"""Files as they lie become a session: every file told, measurements paired with their poses, nothing changed."""

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest

import calib_core as cc
from calib_core.errors import CalibrationError
from calib_core.library.new_session import new_session
from calib_core.recognition.number_rows import rows_in
from calib_core.recognition.pose_rows import poses_in
from calib_core.robots import parse_pose
from server.cli import main
from tests.lying_folders import (
    CONTENT,
    DIAMETER_MM,
    MATRICES,
    SPHERE,
    Files,
    as_yaml,
    folders,
    in_convention,
    lay,
    lines,
)

REAL = Path(__file__).resolve().parents[3] / "shared" / "data" / "as-they-lie" / "sphere-80mm"


def poses_of(folder: Path) -> dict[str, np.ndarray]:
    session = cc.load(folder)
    told = session.cell.pose_convention
    return {c.id: parse_pose(told, c.pose).matrix for c in session.captures if c.pose is not None}


def test_profiles_under_any_key_and_poses_in_a_text_of_any_name(tmp_path: Path) -> None:
    files: Files = {f"p{k}.yml": as_yaml(data) for k, data in enumerate(CONTENT, start=1)}
    files |= {"Robot.txt": lines(in_convention("fanuc")), "rob.rob": json.dumps({"P": in_convention("fanuc")})}
    files |= {"notes.txt": "first try, cable loose\n", "empty.csv": "", ".DS_Store": b"\0\0\0\1Bud1"}
    files["set.sec"] = json.dumps({"CalibObj": {"Name": "Sphere", "Radius": 20.0}, "HTM": np.eye(4).tolist()})
    folder = lay(tmp_path / "stick", files)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    for path in folder.iterdir():
        os.utime(path, (1_700_000_000, 1_700_000_000))
    made = new_session(folder)
    assert made.missing == ()
    assert sorted(file["name"] for file in made.files) == sorted(files)
    told = {file["name"]: file["taken_for"] for file in made.files}
    assert [told[f"p{k}.yml"] for k in range(1, len(CONTENT) + 1)] == ["profiles"] * len(CONTENT)
    assert told["Robot.txt"] == told["rob.rob"] == "poses"
    assert {told[name] for name in ("notes.txt", "empty.csv", ".DS_Store", "set.sec")} == {"nothing"}
    assert all(file["why"] for file in made.files)
    session = cc.load(made.folder)
    assert {(c.taken, c.clock) for c in session.captures} == {("2023-11-14T22:13:20.000Z", "file")}
    assert session.cell.pose_convention == "fanuc"
    assert session.cell.sphere_diameter_mm == 40.0
    found = poses_of(made.folder)
    for k, pose in enumerate(MATRICES, start=1):
        np.testing.assert_allclose(found[f"p{k}"], pose.matrix, atol=1e-4)
    for file in made.files:
        if file["capture"]:
            copy = made.folder / "captures" / f"{file['capture']}.yml"
            assert copy.read_bytes() == before[file["name"]]
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.thorough(keep=4)
@pytest.mark.parametrize("name", folders())
def test_measurements_are_paired_with_their_own_poses(tmp_path: Path, name: str) -> None:
    lying = folders()[name]
    made = new_session(lying.lay(tmp_path / "in"), tmp_path / "out", None, DIAMETER_MM)
    assert made.missing == ()
    assert sorted(file["name"] for file in made.files) == sorted(lying.files)
    assert cc.load(made.folder).cell.pose_convention == lying.convention
    found = poses_of(made.folder)
    capture_of = {file["name"]: file["capture"] for file in made.files if file["capture"]}
    assert {name for name in capture_of if name in lying.measurements} == set(lying.measurements)
    for name, k in lying.measurements.items():
        np.testing.assert_allclose(found[capture_of[name]], MATRICES[k].matrix, atol=2e-3)


def _csv(head: str, rows: list[list[str]], separator: str) -> str:
    return "".join(separator.join(row) + "\r\n" for row in (head.split(separator), *rows))


def _numbers(convention: str, factor: float = 1.0) -> list[list[str]]:
    return [[f"{v:.6f}" for v in (*row[:3], *(factor * a for a in row[3:]))] for row in in_convention(convention)]


NAMES = [f"p{k}" for k in range(1, len(CONTENT) + 1)]
LOG = [
    [f"2026-11-20 10:{k:02d}:00", f"p{k}.csv", *(v.replace(".", ",") for v in row), "OK"]
    for k, row in enumerate(_numbers("fanuc"), start=1)
]
TABLES = {
    "columns of two conventions": ("yaskawa", _csv("x,y,z,rx,ry,rz", _numbers("yaskawa"), ",")),
    "roll, pitch and yaw in radians": (
        "fanuc",
        _csv("x,y,z,roll [rad],pitch [rad],yaw [rad]", _numbers("fanuc", np.pi / 180), ","),
    ),
    "angles under names that no convention has": ("kuka", _csv("x,y,z,alpha,beta,gamma", _numbers("kuka"), ",")),
    "a log with times, in another order": ("fanuc", _csv("Zeit;Datei;X;Y;Z;W;P;R;Status", LOG[::-1], ";")),
    "names behind the numbers": (
        "kuka",
        _csv("X;Y;Z;A;B;C;Name", [[*r, n] for r, n in zip(_numbers("kuka"), NAMES, strict=True)][::-1], ";"),
    ),
}


@pytest.mark.parametrize("name", TABLES)
def test_poses_in_tables_as_cells_write_them(tmp_path: Path, name: str) -> None:
    convention, table = TABLES[name]
    profiles: Files = {f"p{k}.csv": data for k, data in enumerate(CONTENT, start=1)}
    result = json.dumps({"method_revision": 3, "covariance": np.eye(6).tolist()})
    files: Files = {**profiles, "table.csv": table, "tcp.json": result, "old.zip": b"PK\3\4 a/data/session.json"}
    made = new_session(lay(tmp_path / "in", files), tmp_path / "out", None, DIAMETER_MM)
    assert made.missing == ()
    assert cc.load(made.folder).cell.pose_convention == convention
    found = poses_of(made.folder)
    for k, pose in enumerate(MATRICES, start=1):
        np.testing.assert_allclose(found[f"p{k}"], pose.matrix, atol=2e-3)
    why = {file["name"]: file["why"] for file in made.files}
    assert (why["tcp.json"][:8], why["old.zip"][:10]) == ("A result", "An archive")


@pytest.mark.parametrize("head", ["x,y,z,yaw,pitch,roll", "x,y,z,A,B,C", "1,x,y,z,alpha,beta,gamma"])
def test_angles_that_may_be_radians_are_asked_for(tmp_path: Path, head: str) -> None:
    profiles: Files = {f"p{k}.csv": data for k, data in enumerate(CONTENT, start=1)}
    rows = _numbers("kuka", np.pi / 180)
    counted = [[str(k), *row] for k, row in enumerate(rows, start=1)] if head.startswith("1") else rows
    folder = lay(tmp_path / "in", {**profiles, "table.csv": _csv(head.replace("1,", "index,"), counted, ",")})
    made = new_session(folder, tmp_path / "out", None, DIAMETER_MM)
    assert [told for told in made.missing if "degrees or radians" in told]
    told = new_session(folder, tmp_path / "told", "kuka", DIAMETER_MM)  # a controller's own unit is believed
    assert not told.missing
    assert [note for note in told.notes if "degrees or radians" in note]


def test_small_clouds_are_no_poses_and_points_for_thousands_are_none() -> None:
    rows = "".join(f"{k}.5,{k % 7},{200 + k % 3},{k % 90},{k % 5},{k % 11}\n" for k in range(60))
    for names in ("intensity,width,quality", "nx,ny,nz", "red,green,blue"):
        assert poses_in(rows_in(f"x,y,z,{names}\n{rows}"), "cloud.csv") is None
    for line in ("2.111,044;101,7;-1.234.567,5", "2.111,044 101,7 -1.234.567,5"):
        assert rows_in(line).rows[0].numbers == (2111.044, 101.7, -1234567.5)
    assert rows_in("2.111,101.740,821.191").rows[0].numbers == (2.111, 101.74, 821.191)


def _laid(folder: Path, rows: list[list[str]], head: str, more: Files | None = None) -> Path:
    """Lay profiles, the sphere, and a list of KUKA's poses under a head, as a German Excel writes it."""
    profiles: Files = {f"{name}.csv": data for name, data in zip(NAMES, CONTENT, strict=True)}
    table = _csv(head, [[v.replace(".", ",") for v in row] for row in rows], ";")
    return lay(folder, {**profiles, "Posen.csv": table.encode("cp1252"), "kugel.json": SPHERE, **(more or {})})


def test_copies_are_listed_and_are_no_captures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    poses = [[name, *row] for name, row in zip(NAMES, _numbers("kuka"), strict=True)]
    copy_of = {
        "p3 - Kopie.csv": 2, "p4 (2).csv": 3, "p5 - Copy (2).csv": 4, "Kopie von p6.csv": 5, "alt/p7.csv": 6,
        "zuletzt.csv": 1,
    }  # fmt: skip
    copies: Files = {name: CONTENT[k] for name, k in copy_of.items()}
    folder = _laid(tmp_path / "in", poses, "Name;X;Y;Z;A;B;C", copies)
    (folder / "Posen - Kopie.csv").write_bytes((folder / "Posen.csv").read_bytes())
    assert main(["new", str(folder), "--out", str(tmp_path / "out"), "--json"]) == 0
    made = json.loads(capsys.readouterr().out)
    assert (made["captures"], made["missing"]) == (len(CONTENT), [])
    assert sorted(f["name"] for f in made["files"]) == sorted(
        path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()
    )
    told = {file["name"]: (file["taken_for"], file["why"]) for file in made["files"]}
    for name, k in copy_of.items():
        assert told[name] == ("nothing", f"The same content as p{k + 1}.csv: a copy.")
    assert told["Posen - Kopie.csv"] == ("nothing", "The same content as Posen.csv: a copy.")
    kept = new_session(folder, tmp_path / "told", told={"p3 - Kopie.csv": "profiles"})
    assert kept.captures == len(CONTENT) + 1  # what somebody says is no copy is none


def test_two_captures_of_one_content_that_have_their_own_poses_are_no_copies(tmp_path: Path) -> None:
    poses = [[name, *row] for name, row in zip(NAMES, _numbers("kuka"), strict=True)]
    folder = _laid(tmp_path / "in", poses, "Name;X;Y;Z;A;B;C", {"p2.csv": CONTENT[0]})
    made = new_session(folder, tmp_path / "out")
    assert made.captures == len(CONTENT)  # a scanner that stood still: the quality of captures says so


def test_rows_that_are_not_whole_keep_their_place_and_are_named(tmp_path: Path) -> None:
    rows = _numbers("kuka")
    rows[4], rows[6] = ["", *rows[4][1:]], rows[6][:4]
    made = new_session(_laid(tmp_path / "in", rows, "X;Y;Z;A;B;C"), tmp_path / "out")
    assert "Posen.csv has no whole pose in line 6, 8." in made.notes
    assert "No pose for p5.csv, p7.csv." in made.missing
    assert [file["why"][:8] for file in made.files if file["name"] == "Posen.csv"] == ["12 poses"]
    found = poses_of(made.folder)
    assert sorted(found) == sorted(name for name in NAMES if name not in ("p5", "p7"))
    for name, pose in found.items():
        np.testing.assert_allclose(pose, MATRICES[NAMES.index(name)].matrix, atol=2e-3)


def test_table_angles_left_blank_are_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [[*row, "" if k % 4 == 3 else str(10 * k)] for k, row in enumerate(_numbers("kuka"))]
    folder = _laid(tmp_path / "in", rows, "X;Y;Z;A;B;C;table_deg")
    made = new_session(folder, tmp_path / "out")
    assert [lack[:58] for lack in made.missing] == ["Posen.csv leaves the table's angle open in line 5, 9, 13: "]
    captures = cc.load(made.folder).captures
    assert {c.step for c in captures} == {"turntable"}
    assert [c.table_deg for c in captures[:5]] == [0.0, 10.0, 20.0, None, 40.0]
    assert main(["new", str(folder), "--out", str(tmp_path / "de"), "--lang", "de"]) == 1
    _, *files, last = capsys.readouterr().out.splitlines()
    assert last.startswith("Posen.csv lässt den Winkel des Drehtischs in Zeile 5, 9, 13 offen: ")
    assert not [line for line in files if re.search(r"\b(the|of|were|all|is|and|poses|as)\b", line)], files


def test_what_is_missing_is_named_and_the_session_is_written_all_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = lay(tmp_path / "in", {f"p{k}.csv": data for k, data in enumerate(CONTENT, start=1)})
    assert main(["new", str(folder), "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["session"] == str(tmp_path / "in-session")
    assert told["missing"] == [
        "No file holds where the robot stood: give its poses.",
        "The sphere's diameter is missing.",
    ]
    assert len(cc.load(told["session"]).captures) == len(CONTENT)
    assert main(["new", str(folder), "--out", str(tmp_path / "zwei"), "--lang", "de"]) == 1
    assert "p1.csv: Profile (p1). " in (said := capsys.readouterr().out)
    assert "Zahlen: Punkte." in said
    few = lay(
        tmp_path / "few", {"p1.csv": CONTENT[0], "p2.csv": CONTENT[1], "r.txt": lines(in_convention("fanuc")[:2])}
    )
    assert main(["new", str(few), "--sphere-mm", "40", "--json"]) == 1
    assert "convention" in json.loads(capsys.readouterr().out)["missing"][0]


def test_nothing_is_written_where_something_lies_or_into_the_folder(tmp_path: Path) -> None:
    folder = lay(tmp_path / "in", {"p1.csv": CONTENT[0]})
    taken = lay(tmp_path / "taken", {"mine.txt": "mine"})
    for out in (taken, folder, folder / "below", tmp_path / "taken" / "mine.txt"):
        with pytest.raises(CalibrationError):
            new_session(folder, out)
    assert [p.name for p in folder.rglob("*")] == ["p1.csv"]
    assert [p.name for p in taken.rglob("*")] == ["mine.txt"]
    for wrong in (tmp_path / "absent", folder / "p1.csv"):
        with pytest.raises(CalibrationError):
            new_session(wrong)
    with pytest.raises(CalibrationError):
        new_session(folder, convention="kuca")


def test_links_are_not_followed(tmp_path: Path) -> None:
    secret = lay(tmp_path / "secret", {"p9.csv": CONTENT[0]})
    folder = lay(tmp_path / "in", {"p1.csv": CONTENT[1]})
    (folder / "p2.csv").symlink_to(secret / "p9.csv")
    (folder / "more").symlink_to(secret)
    made = new_session(folder)
    assert {f["name"]: f["taken_for"] for f in made.files} == {
        "p1.csv": "profiles", "p2.csv": "nothing", "more": "nothing",
    }  # fmt: skip
    assert sorted(p.name for p in (made.folder / "captures").iterdir()) == ["p1.csv"]


@pytest.mark.thorough
@pytest.mark.skipif(not REAL.is_dir(), reason="the real files are not here")
def test_a_real_folder_becomes_its_session(tmp_path: Path) -> None:
    made = new_session(REAL, tmp_path / "out")
    assert (made.missing, made.captures, len(made.files)) == ((), 15, 18)
    ready = cc.load(REAL.parents[1] / "tcp-sphere-80mm")
    for mine, theirs in zip(cc.load(made.folder).captures, ready.captures, strict=True):
        assert mine.pose == theirs.pose
    found, right = (folder.run("tcp")["tcp"] for folder in (cc.load(made.folder), ready))
    np.testing.assert_allclose(found.tool0_from_laser, right.tool0_from_laser, atol=1e-3)
