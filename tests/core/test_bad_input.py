"""Every bad input that a user was ever seen to give, by the real command: exit status 2 and one clear sentence."""

import json
import math
import shutil

import pytest

from calib_core.robots import parse_pose, to_pose
from server.cli import main


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    folder = tmp_path_factory.mktemp("good") / "session"
    assert main(["simulate", "tcp", "--seed", "5", "--out", str(folder)]) == 0
    return folder


@pytest.fixture
def folder(good, tmp_path):
    return shutil.copytree(good, tmp_path / "cell")


def change(folder, change_record):
    path = folder / "session.json"
    record = json.loads(path.read_text())
    change_record(record)
    path.write_text(json.dumps(record))


def refused(folder, capsys, *said, arguments=("--json",)):
    """Solve, and return the sentence that says why not, after checking its form."""
    assert main(["run", str(folder), *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("scancell: error: ")
    assert err.count("\n") == 1, err
    assert "Traceback" not in err
    for words in said:
        assert words in err
    assert not (folder / "results").exists()
    return err


def write_profile(folder, name, points):
    (folder / "captures" / name).write_text("x_mm,z_mm\n" + "".join(f"{x},{z}\n" for x, z in points))


def test_empty_profile(folder, capsys):
    (folder / "captures" / "p03.csv").write_bytes(b"")
    refused(folder, capsys, "captures/p03.csv", "an empty file", "Copy or export it again")


@pytest.mark.parametrize("points", [[(x, "nan") for x in range(100)], [("", "")] * 100, []])
def test_a_profile_of_blanks_is_rejected_and_the_others_solve(folder, capsys, points):
    write_profile(folder, "p03.csv", points)
    assert main(["run", str(folder), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["results"]["tcp"]["residuals"]
    assert [row["capture"] for row in rows if not row["used"]] == ["p03"]
    reason = next(row["reason"] for row in rows if not row["used"])
    assert ("100 blanks" if points else "none: nothing came back") in reason
    assert "take the capture again" in reason


def test_text_for_numbers(folder, capsys):
    write_profile(folder, "p03.csv", [(1, 2), (3, "oops")])
    refused(folder, capsys, "captures/p03.csv", "'oops' in line 3")


def test_truncated_file(folder, capsys):
    path = folder / "captures" / "p03.csv"
    whole = path.read_bytes()
    path.write_bytes(whole[: whole.rindex(b",", 0, len(whole) // 2)])
    refused(folder, capsys, "captures/p03.csv", "cut off", "copy it again")


def test_missing_file(folder, capsys):
    (folder / "captures" / "p03.csv").unlink()
    refused(folder, capsys, "captures/p03.csv", "no such file", "Copy the file there")


def test_file_of_200_mb_is_refused_unread(folder, capsys):
    with (folder / "captures" / "p03.csv").open("wb") as file:
        file.truncate(200_000_000)
    refused(folder, capsys, "captures/p03.csv", "200 MB", "at most")


def test_link_out_of_the_folder(folder, capsys, tmp_path):
    outside = tmp_path / "outside.csv"
    outside.write_text("1,2\n")
    (folder / "captures" / "p03.csv").unlink()
    (folder / "captures" / "p03.csv").symlink_to(outside)
    refused(folder, capsys, "captures/p03.csv", "leads out of it")


def test_path_out_of_the_folder(folder, capsys):
    change(folder, lambda r: r["captures"][2].update(files=["../outside.csv"]))
    refused(folder, capsys, "captures[p03].files", "'../outside.csv'")


def test_session_json_is_not_json(folder, capsys):
    (folder / "session.json").write_text('{\n "format": "scancell-session/1",\n name: 4}\n')
    refused(folder, capsys, "session.json", "line 3, column 2")


def test_session_json_is_cut_off(folder, capsys):
    text = (folder / "session.json").read_text()
    (folder / "session.json").write_text(text[: text.index("pose_convention") + 17])
    refused(folder, capsys, "session.json", "ends too early", "Copy or export it again")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "an empty file"),
        (b"[]", "a list"),
        (b"\xff\xfe\x00", "a byte that is no text"),
        (b'{"cell": {"pose_convention": "abb"}}', "the field 'format'"),
        (b'{"format": "scancell-session/2", "cell": {"pose_convention": "abb"}}', "'scancell-session/2'"),
        (b'{"format": "scancell-session/1"}', "the field 'cell'"),
        (b'{"format": "scancell-session/1", "cell": {"pose_convention": "abb"}, "x": NaN}', "NaN or infinity"),
        (b"[" * 100_000, "ordinary depth"),
    ],
)
def test_session_json_is_no_session(folder, capsys, content, said):
    (folder / "session.json").write_bytes(content)
    refused(folder, capsys, "session.json", said)


def test_session_json_missing(tmp_path, capsys):
    folder = tmp_path / "empty"
    folder.mkdir()
    refused(folder, capsys, "session.json", "no such file")


def test_no_folder_at_all(tmp_path, capsys):
    refused(tmp_path / "nowhere", capsys, "nowhere", "nothing there", "Name the session's folder")


def test_unknown_convention_lists_all(folder, capsys):
    change(folder, lambda r: r["cell"].update(pose_convention="motoman"))
    said = refused(folder, capsys, "cell.pose_convention", "'motoman'")
    for name in ("matrix", "abb", "kuka", "fanuc", "ur", "staubli", "yaskawa", "ros"):
        assert name in said


def test_pose_of_five_numbers(folder, capsys):
    change(folder, lambda r: r["captures"][2].update(pose=[1.0, 2.0, 3.0, 4.0, 5.0]))
    refused(folder, capsys, "p03", "a pose of 7 numbers", "got 5 numbers")


def test_pose_with_nan(folder, capsys):
    change(folder, lambda r: r["captures"][2]["pose"].__setitem__(1, math.nan))
    refused(folder, capsys, "captures[p03].pose[1]", "a finite number", "nan")


def test_pose_missing(folder, capsys):
    change(folder, lambda r: r["captures"][2].pop("pose"))
    refused(folder, capsys, "p03", "the robot's pose", "none")


def test_poses_in_metres_are_named(folder, capsys):
    def in_metres(record):
        for capture in record["captures"]:
            capture["pose"][:3] = [value / 1000 for value in capture["pose"][:3]]

    change(folder, in_metres)
    refused(folder, capsys, "pose", "look like metres", "Multiply x y z by 1000")


def test_poses_in_millimetres_for_metres_are_named(folder, capsys):
    def as_ros(record):
        record["cell"]["pose_convention"] = "ros"
        for capture in record["captures"]:
            pose = to_pose("quaternion-xyzw", parse_pose("abb", capture["pose"]))
            capture["pose"] = pose

    change(folder, as_ros)
    refused(folder, capsys, "pose", "look like millimetres", "Divide x y z by 1000")


@pytest.mark.thorough
def test_profiles_in_metres_are_named(folder, capsys):
    for path in (folder / "captures").glob("*.csv"):
        rows = [line.split(",") for line in path.read_text().splitlines()[1:]]
        write_profile(folder, path.name, [(float(x) / 1000, float(z) / 1000 if z else "") for x, z in rows])
    refused(folder, capsys, "captures/", "look like metres")


@pytest.mark.thorough
def test_diameter_in_metres_is_named(folder, capsys):
    change(folder, lambda r: r["cell"].update(sphere_diameter_mm=0.04))
    refused(folder, capsys, "looks like metres", "40")


@pytest.mark.thorough
def test_radius_for_diameter_is_named(folder, capsys):
    change(folder, lambda r: r["cell"].update(sphere_diameter_mm=20.0))
    refused(folder, capsys, "captures/", "radius", "14 captures")


@pytest.mark.thorough
def test_sphere_larger_than_the_cell_says(folder, capsys):
    change(folder, lambda r: r["cell"].update(sphere_diameter_mm=15.0))
    refused(folder, capsys, "an arc of radius ≤ 7.5 mm", "larger than stated")


def test_diameter_missing(folder, capsys):
    change(folder, lambda r: r["cell"].pop("sphere_diameter_mm"))
    refused(folder, capsys, "cell.sphere_diameter_mm", "certificate")


def test_no_arc_in_any_profile(folder, capsys):
    for path in (folder / "captures").glob("*.csv"):
        write_profile(folder, path.name, [(x / 10, 200.0 + (x % 7) / 500) for x in range(-300, 300)])
    refused(folder, capsys, "captures/p01.csv", "arc", "14 of 14 captures do not show the sphere")


def test_all_poses_equal(folder, capsys):
    def equal(record):
        for capture in record["captures"]:
            capture["pose"] = record["captures"][0]["pose"]

    change(folder, equal)
    refused(folder, capsys, "14 captures from one and the same pose", "Record the robot's pose anew")


@pytest.mark.thorough
def test_one_orientation_only(folder, capsys):
    def one_orientation(record):
        for capture in record["captures"]:
            capture["pose"][3:] = record["captures"][0]["pose"][3:]

    change(folder, one_orientation)
    assert main(["run", str(folder), "--stage", "tcp"]) == 1
    assert "Check the pose convention" in " ".join(capsys.readouterr().out.split())


def test_too_few_captures(folder, capsys):
    change(folder, lambda r: r.update(captures=r["captures"][:3]))
    refused(folder, capsys, "at least", "got 3")


def test_the_same_capture_id_twice(folder, capsys):
    change(folder, lambda r: r["captures"].append(r["captures"][2]))
    refused(folder, capsys, "capture ids that differ", "'p03' twice")


def test_no_tcp_captures(folder, capsys):
    change(folder, lambda r: r.update(captures=[]))
    refused(folder, capsys, "captures with step 'tcp'", "none")


def test_a_known_tool_is_not_solved(folder, capsys):
    identity = [[float(i == j) for j in range(4)] for i in range(4)]
    change(folder, lambda r: r["cell"].update(known={"tool0_from_laser": identity}))
    refused(folder, capsys, "cell.known", arguments=("--stage", "tcp"))


def test_unknown_stage(folder, capsys):
    refused(folder, capsys, "stage: need one of all, camera, laser-plane", "'tpc'", arguments=("--stage", "tpc"))


def test_a_stage_without_captures_says_what_to_capture(folder, capsys):
    refused(folder, capsys, "captures with step 'verify'", "not used for the TCP", arguments=("--stage", "verify"))


def test_an_out_folder_that_cannot_be_written(folder, capsys, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert main(["run", str(folder), "--out", str(blocked)]) == 2
    assert "a place to write to" in capsys.readouterr().err
    assert blocked.read_text() == ""


def test_check_finds_all_at_once(folder, capsys):
    (folder / "captures" / "p03.csv").write_bytes(b"")
    (folder / "captures" / "p04.csv").unlink()
    change(folder, lambda r: r["captures"][5].update(pose=[1.0, 2.0]))
    change(folder, lambda r: r["cell"].update(sphere_diamter_mm=40))
    assert main(["check", str(folder)]) == 2
    out, err = capsys.readouterr()
    for words in ("p03.csv", "p04.csv", "p06", "'sphere_diamter_mm'"):
        assert words in out
    assert out.splitlines()[0].startswith("error")
    assert "3 findings block solving" in err


def test_check_names_a_copied_file(folder, capsys):
    shutil.copy(folder / "captures" / "p02.csv", folder / "captures" / "p03.csv")
    assert main(["check", str(folder)]) == 0
    assert "p03: The file of p03 is that of p02, byte for byte, but its pose is another" in capsys.readouterr().out


def test_check_says_which_motion_is_missing(folder, capsys):
    change(folder, lambda r: r.update(captures=r["captures"][:4]))
    assert main(["check", str(folder)]) == 2
    out = capsys.readouterr().out
    assert "Captures that can be used: 4. At least 5 are needed." in out
    assert "tilted 0 times; at least 3 tilts" in out
