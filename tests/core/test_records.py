"""Records: the published session format comes back as it was, and what is wrong in it is named."""

import copy
import json
import math
import re
from typing import Any, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from calib_core.errors import InputError
from calib_core.records import Capture, PoseConvention, parse_capture, parse_cell, parse_session

# The example of the published session format, to the letter.
EXAMPLE = """
{
  "format": "scancell-session/1",
  "name": "cell 4",
  "cell": {
    "sphere_diameter_mm": 80.0,
    "sphere_diameter_sigma_mm": 0.002,
    "pose_convention": "fanuc",
    "scanner": {"kind": "profile", "point_sigma_mm": 0.02},
    "robot": {"position_sigma_mm": 0.05, "orientation_sigma_deg": 0.01},
    "turntable": {"direction": 1, "angle_sigma_deg": 0.003},
    "board": {"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 25.0}
  },
  "captures": [
    {"id": "p01", "step": "tcp", "kind": "profile", "files": ["captures/p01.csv"],
     "pose": [-195.8, 1363.305, 524.812, -179.924, 0.889, 179.635]},
    {"id": "t01", "step": "turntable", "kind": "profile", "files": ["captures/t01.csv"],
     "pose": [-170.1, 1301.2, 530.0, -179.9, 0.9, 179.6], "table_deg": 45.0, "mount": "low"}
  ]
}
"""
SMALL_PRINT: dict[str, Any] = {
    "format": "scancell-session/1",
    "cell": {
        "pose_convention": "quaternion-xyzw",
        "scanner": {"z_axis": "toward"},
        "board": {
            "kind": "charuco", "columns": 9, "rows": 6, "pitch_mm": 25.0, "marker_mm": 18.0,
            "dictionary": "DICT_4X4_50",
        },
        "known": {
            "camera": {"camera_matrix": [[900, 0, 320], [0, 900, 240], [0, 0, 1]], "distortion": {"k1": -0.1}},
            "laser_plane": {"normal": [0, 0.9, 0.43], "distance_mm": 15.5},
            "tool0_from_laser": [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]],
            "base_from_turntable": [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]],
        },
    },
    "captures": [
        {"id": "c1", "step": "tcp", "kind": "center", "center_mm": [1, 2, 3], "pose": [0, 0, 0, 0, 0, 0, 1]},
        {
            "id": "s1", "step": "scan", "kind": "sweep", "files": ["captures/a.csv", "captures/b.csv"],
            "poses": [[0, 0, 0, 0, 0, 0, 1], [1, 0, 0, 0, 0, 0, 1]],
        },
        {
            "id": "s2", "step": "scan", "kind": "sweep", "files": ["captures/c.npy"], "timestamps_s": [0.5],
            "pose_track": [
                {"t_s": 0.0, "pose": [0, 0, 0, 0, 0, 0, 1]}, {"t_s": 1.0, "pose": [9, 0, 0, 0, 0, 0, 1]},
            ],
        },
        {"id": "l1", "step": "laser-plane", "kind": "frame", "files": ["captures/lit.png", "captures/stripe.png"]},
    ],
}  # fmt: skip


def example() -> dict[str, Any]:
    return json.loads(EXAMPLE)


def changed(path: list[Any], value: Any) -> dict[str, Any]:
    data = example()
    at: Any = data
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    return data


@pytest.mark.parametrize("data", [example(), SMALL_PRINT], ids=["example", "small print"])
def test_a_session_comes_back_as_it_was(data: dict[str, Any]) -> None:
    written = parse_session(copy.deepcopy(data)).to_json()
    assert written == data
    assert parse_session(json.loads(json.dumps(written))).to_json() == data


def test_numbers_come_back_digit_by_digit() -> None:
    assert json.dumps(parse_session(example()).to_json(), sort_keys=True) == json.dumps(example(), sort_keys=True)


JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=10),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)  # fmt: skip


@given(JSON_VALUES, st.sampled_from([(), ("cell",), ("cell", "robot"), ("captures", 0), ("cell", "board")]))
def test_unknown_fields_are_kept_wherever_they_are(value: Any, place: tuple[Any, ...]) -> None:
    data = changed([*place, "x_of_another_program"], value)
    session = parse_session(data)
    assert session.to_json() == data
    at: Any = session
    for key in place:
        at = at[key] if isinstance(key, int) else getattr(at, key)
    assert at.unknown_fields() == ["x_of_another_program"]


def test_only_the_necessary_must_be_given() -> None:
    least: dict[str, Any] = {"format": "scancell-session/1", "cell": {"pose_convention": "kuka"}}
    session = parse_session(least)
    assert session.to_json() == least
    assert session.captures == []
    assert session.cell.sphere_diameter_mm is None
    assert session.cell.robot.position_sigma_mm is None
    capture = {"id": "p1", "step": "tcp", "kind": "profile", "files": ["captures/p1.csv"]}
    assert parse_capture(capture).to_json() == capture


def test_records_cannot_be_changed() -> None:
    session = parse_session(example())
    with pytest.raises(ValueError, match="frozen"):
        session.name = "other"  # pyright: ignore[reportAttributeAccessIssue]


def test_an_unknown_convention_lists_all_names() -> None:
    with pytest.raises(InputError) as caught:
        parse_cell({"pose_convention": "comau"})
    assert "'comau'" in str(caught.value)
    names = get_args(PoseConvention)
    assert len(names) == 13
    assert all(f" {name}," in f" {caught.value.need}," for name in names)


def test_a_missing_convention_is_named() -> None:
    with pytest.raises(
        InputError, match=r"cell\.pose_convention: .*got nothing.*pose conventions|pose_convention"
    ):
        parse_session({"format": "scancell-session/1", "cell": {}})


@pytest.mark.parametrize(
    "name",
    [
        "../secret",
        "captures/../../secret",
        "captures/..",
        "/etc/passwd",
        "captures\\..\\secret",
        "..\\secret",
        "captures/a\0.csv",
        "C:/secret.csv",
        "C:secret.csv",
        "file:///etc/passwd",
        "",
    ],
)
def test_a_file_outside_the_session_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="a file inside the session folder") as caught:
        parse_session(changed(["captures", 0, "files"], ["captures/p01.csv", name]))
    assert caught.value.where == "session.json: captures[p01].files"
    assert caught.value.to_do == "Copy it into captures/."


@pytest.mark.parametrize(
    "name", ["captures/p01.csv", "p01.csv", "captures/deep/er/p01.csv", "captures/..a.csv", "ä ö.csv"]
)
def test_a_file_inside_the_session_is_taken(name: str) -> None:
    assert parse_session(changed(["captures", 0, "files"], [name])).captures[0].files == [name]


def test_a_capture_id_twice_is_named() -> None:
    with pytest.raises(InputError, match="'p01' twice") as caught:
        parse_session(changed(["captures", 1, "id"], "p01"))
    assert caught.value.need == "capture ids that differ"


@pytest.mark.parametrize("name", ["", "../p01", "a/b", ".hidden", "p 1", "p01\n", "x" * 65, "ä", "a\0"])
def test_an_id_that_is_no_file_name_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=r"(?s)captures\[.*\]\.id"):
        parse_session(changed(["captures", 0, "id"], name))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(
    "path",
    [
        ["captures", 0, "pose", 2],
        ["captures", 1, "table_deg"],
        ["cell", "sphere_diameter_mm"],
        ["cell", "sphere_diameter_sigma_mm"],
        ["cell", "scanner", "point_sigma_mm"],
        ["cell", "robot", "position_sigma_mm"],
        ["cell", "robot", "orientation_sigma_deg"],
        ["cell", "turntable", "angle_sigma_deg"],
        ["cell", "board", "pitch_mm"],
    ],
    ids=lambda path: str(path[-1]) if isinstance(path, list) else None,
)
def test_nan_and_infinity_are_refused_where_they_stand(path: list[Any], value: float) -> None:
    with pytest.raises(InputError) as caught:
        parse_session(changed(path, value))
    assert str(path[-1]) in caught.value.where
    assert "finite" in caught.value.need or "greater" in caught.value.need


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (["cell", "sphere_diameter_mm"], 0.0),
        (["cell", "sphere_diameter_mm"], -80.0),
        (["cell", "sphere_diameter_sigma_mm"], -0.1),
        (["cell", "robot", "position_sigma_mm"], -0.1),
        (["cell", "turntable", "direction"], 2),
        (["cell", "scanner", "z_axis"], "up"),
        (["captures", 0, "step"], "tcpp"),
        (["captures", 0, "kind"], "photo"),
        (["captures", 0, "pose"], "1 2 3"),
        (["captures", 0, "side"], 0),
        (["format"], "scancell-session/2"),
    ],
)
def test_a_value_out_of_range_is_refused_where_it_stands(path: list[Any], value: Any) -> None:
    with pytest.raises(InputError) as caught:
        parse_session(changed(path, value))
    assert str(path[-1]) in caught.value.where
    assert repr(value) == caught.value.got
    assert caught.value.to_do


def test_a_capture_needs_its_data() -> None:
    with pytest.raises(InputError, match="at least one file in `files` of a 'profile' capture"):
        parse_capture({"id": "p1", "step": "tcp", "kind": "profile"})
    with pytest.raises(InputError, match="center_mm"):
        parse_capture({"id": "p1", "step": "tcp", "kind": "center"})


def test_what_is_not_a_number_is_refused_not_guessed_quietly() -> None:
    with pytest.raises(InputError, match=r"captures\[p01\]\.pose"):
        parse_session(changed(["captures", 0, "pose", 0], "12,5"))


def test_several_faults_are_counted() -> None:
    data = changed(["cell", "sphere_diameter_mm"], -1)
    data["captures"][0]["step"] = "none"
    with pytest.raises(InputError, match=r"1 more field will need attention"):
        parse_session(data)


def test_the_schema_names_every_field_of_a_capture() -> None:
    known = set(Capture.model_json_schema()["properties"])
    assert {
        "id",
        "step",
        "kind",
        "files",
        "pose",
        "table_deg",
        "mount",
        "center_mm",
        "poses",
        "timestamps_s",
    } <= known


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"cell": 3}, "cell: need an object in braces, got 3."),
        ({"captures": {}}, "captures: need a list in brackets, got {}."),
        ({"cell": {"pose_convention": "abb", "sphere_diameter_mm": -3}}, "need more than 0, got -3."),
        ({"cell": {"pose_convention": "abb", "sphere_diameter_mm": 5e-324}}, "need at least 1e-20, got 5e-324."),
        (
            {"cell": {"pose_convention": "abb", "sphere_diameter_sigma_mm": 1e300}},
            "need at most 1e+20, got 1e+300.",
        ),
        ({"cell": {"pose_convention": "abb", "sphere_diameter_mm": "40 mm"}}, "need a number, got '40 mm'."),
        (
            {"cell": {"pose_convention": "abb", "known": {"tool0_from_laser": [[1, 2]]}}},
            "known.tool0_from_laser[0]: need a list of at least 4, got 2: [1, 2].",
        ),
    ],
)
def test_a_field_of_another_kind_is_refused_in_plain_words(change: dict[str, Any], sentence: str) -> None:
    record = {"format": "scancell-session/1", "cell": {"pose_convention": "abb"}, "captures": []}
    with pytest.raises(InputError, match=re.escape(sentence)):
        parse_session({**record, **change})


@pytest.mark.parametrize(("diameter_mm", "x_mm"), [(True, 1.0), (25.0, True)])
def test_true_is_no_number(diameter_mm: object, x_mm: object) -> None:
    """It was taken for 1: a sphere of one millimetre."""
    capture = {"id": "p1", "step": "tcp", "kind": "profile", "files": ["a.csv"], "pose": [x_mm, 2, 3, 4, 5, 6]}
    cell = {"pose_convention": "kuka", "sphere_diameter_mm": diameter_mm}
    with pytest.raises(InputError, match="got True"):
        parse_session({"format": "scancell-session/1", "cell": cell, "captures": [capture]}, "s")
