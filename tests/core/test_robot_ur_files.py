"""Programs and installations of Universal Robots as PolyScope keeps them: gzipped XML."""

import gzip
import math
import zlib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib_core.errors import InputError
from calib_core.exports.export import export
from calib_core.formats.shared.xml_file import gzipped_as
from calib_core.robots import parse_pose
from calib_core.robots.backup import read_controller_files
from tests.core.test_robot_exports import SESSION, TOOL, near, results

JOINTS = (1.9942, -1.6684, 1.9330, -0.2718, 1.3209, 0.0036)
THETA = (-8.8e-8, -0.0326, -0.8773, 0.9099, 2.1e-6, -1.9e-7)
A = (1.2e-4, -0.6118, -0.3506, 6.3e-5, -8.5e-5, 0.0)
D = (0.1811, -11.9861, 254.0218, -241.8614, 0.1198, 0.1157)  # as linearized tables have them: huge, and cancelling
ALPHA = (1.5706, 0.00166, -0.00186, 1.5707, -1.5704, 0.0)
NOMINAL = ((0.0,) * 6, (0, -0.425, -0.3922, 0, 0, 0), (0.1625, 0, 0, 0.1333, 0.0997, 0.0996),
           (math.pi / 2, 0, 0, math.pi / 2, -math.pi / 2, 0))  # fmt: skip
EMPTY = ((0.0,) * 6,) * 4


def table(tag: str, status: str, rows: Any) -> str:
    names = ("deltaTheta", "a", "d", "alpha")
    inside = "".join(f'<{n} value="{", ".join(map(repr, row))}"/>' for n, row in zip(names, rows, strict=True))
    return (
        f'<{tag} status="{status}" validChecksum="true">{inside}<jointChecksum value="-1,-1,-1,-1,-1,-1"/></{tag}>'
    )


def waypoint(inside: str, kind: str = "Fixed", joints: Any = JOINTS) -> str:
    angles = ", ".join(map(repr, joints))
    return (
        f'<Waypoint type="{kind}" name="Weg 1" kinematicsFlags="1">\n<motionParameters/>\n<position>\n'
        f'<JointAngles angles="{angles}"/>\n<TCPOffset pose="0.0, 0.0, 0.12, 0.0, 0.0, 0.0"/>\n{inside}\n'
        f'</position>\n<BaseToFeature pose="0.1, 0, 0, 0, 0, 0"/></Waypoint>'
    )


def program(inside: str, own: str = "") -> bytes:
    head = '<?xml version="1.0" encoding="UTF-8"?>\n<URProgram name="a">'
    text = f"{head}\n{own}\n<children>{inside}</children></URProgram>"
    return gzip.compress(text.encode())


def flange(rows: Any, joints: Any = JOINTS) -> np.ndarray:
    """The flange by turns and shifts one after the other; the package multiplies closed forms."""
    pose = np.eye(4)
    for q, start, a, d, alpha in zip(joints, *rows, strict=True):
        for axis, turn, shift in (("z", q + start, (0, 0, d)), ("x", alpha, (a, 0, 0))):
            step = np.eye(4)
            step[:3, :3] = Rotation.from_euler(axis, turn).as_matrix()
            step[:3, 3] = shift
            pose = pose @ step
    pose[:3, 3] *= 1000
    return pose


@pytest.mark.parametrize("beside", [True, False], ids=["beside", "of the program"])
@pytest.mark.parametrize(("rows", "status"), [((THETA, A, D, ALPHA), "LINEARIZED"), (NOMINAL, "NOT_INITIALIZED")])
def test_a_waypoint_is_the_flange_by_the_programs_own_arm(rows: Any, status: str, beside: bool) -> None:
    inside = table("Kinematics", status, rows) if beside else ""
    own = table("kinematics", "NOT_LINEARIZED", EMPTY) if beside else table("kinematics", status, rows)
    found = read_controller_files({"a.urp": program(waypoint(inside), own)})
    (pose,) = found.poses
    assert (pose.name, pose.tool, pose.frame, found.skipped) == ("Weg 1", 0, "base", ())
    assert pose.pose is not None
    np.testing.assert_allclose(parse_pose("ur", pose.pose).matrix, flange(rows), atol=1e-9)
    assert ("nominal lengths" in pose.doubt) == (status != "LINEARIZED")
    np.testing.assert_allclose(np.radians(pose.joints_deg or ()), JOINTS)


def test_a_program_that_no_robot_saved_has_joints_alone_and_other_waypoints_are_no_places() -> None:
    own = table("kinematics", "NOT_LINEARIZED", EMPTY)
    found = read_controller_files({"a.urp": program(waypoint(""), own)})
    assert [pose.pose for pose in found.poses] == [None]
    assert "joints alone" in found.skipped[0].reason
    moved = read_controller_files({"a.urp": program(waypoint("", "Relative"), own)})
    assert (moved.poses, "waypoint of type Relative" in moved.skipped[0].reason) == ((), True)
    cut = read_controller_files({"a.urp": program(waypoint("", joints=JOINTS[:5]), own)})
    assert (cut.poses, len(cut.skipped), cut.skipped[0].line) == ((), 1, 7)


def test_the_scripts_in_a_program_are_read_at_their_lines() -> None:
    script = "set_tcp(p[0,0,0.1,0,0,0])\nmovel(p[0.1,0.2,0.3,0,0,0], a=1)\n"
    copy = f'<Script type="File"><cachedContents>{script}</cachedContents></Script>'
    (pose,) = read_controller_files({"a.urp": program(copy)}).poses
    assert (pose.line, pose.pose) == (5, pytest.approx((0.1, 0.2, 0.2, 0, 0, 0)))


def test_a_variable_that_only_enters_a_calculation_is_no_place_of_the_robot() -> None:
    rows = (
        "feature = p[1,0,0,0,0,1]",
        "global p1 = p[0.1,0.2,0.3,0,0,0]",
        "global p2 = p[0.4,0.2,0.3,0,0,0]",
        "movel(pose_trans(feature, p1), a=1)",
        "movel(pose_trans(p2, p[0,0,0.1,0,0,0]), a=1)",
        "movel(p2, a=1)",
    )
    read = read_controller_files({"a.script": "\n".join(rows).encode()})
    assert [pose.name for pose in read.poses] == ["p2"]
    assert [one.line for one in read.skipped] == [1, 2, 5]


def installation(active: str = "Greifer", offset: str = "0.0, 0.0, 0.1, 0.0, 0.0, 0.0") -> bytes:
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<Installation directory="/programs" fileName="default">
  <TCPSettings activePose="{active}">
    <availablePoses>
      <tcp id="a" name="Greifer" offset="{offset}"/>
      <tcp id="b" name="Sänner &amp; 2"
           offset='0.0, 0.0, 0.0, 0.0, 0.0, 0.0'/>
    </availablePoses>
  </TCPSettings>
  <SafetySettings>
[SafetyLimits Normal Values]
maxTcpSpeed = 1.5
  </SafetySettings>
  <PayloadSettings><Payload name="Greifer" mass="1.2" centerOfGravity="0.0, 0.0, 0.05"/></PayloadSettings>
</Installation>
""".encode()


@pytest.mark.parametrize("active", ["Greifer", "a"])
def test_the_active_tcp_of_the_installation_is_taken_where_a_script_names_none(active: str) -> None:
    script = b"def a():\n  here=p[0.1,0.2,0.3,0,0,0]\n  movel(here, a=1)\nend\n"
    files = {"a.script": script, "default.installation": gzip.compress(installation(active))}
    (pose,) = read_controller_files(files).poses
    assert (pose.tool, pose.pose) == ("Greifer", pytest.approx((0.1, 0.2, 0.2, 0, 0, 0)))
    assert "active in the backup, Greifer, is taken" in pose.doubt
    own = files | {"a.script": script.replace(b"def a():", b"def a():\n  set_tcp(p[0,0,0.05,0,0,0])")}
    assert read_controller_files(own).poses[0].pose == pytest.approx((0.1, 0.2, 0.25, 0, 0, 0))
    unknown = files | {"default.installation": gzip.compress(installation("none"))}
    assert "does not say with which tool" in read_controller_files(unknown).poses[0].doubt


@pytest.mark.parametrize("name", ["Greifer", "Sänner & 2"])
@pytest.mark.parametrize("pack", [gzip.compress, bytes], ids=["gzipped", "plain"])
def test_one_tcp_of_an_installation_changes_and_no_other_byte(name: str, pack: Callable[[bytes], bytes]) -> None:
    before = installation()
    content, _ = export(SESSION, results(), "ur", settings={"tool": name}, backup=pack(before))
    after = gzip.decompress(content) if content.startswith(b"\x1f\x8b") else content
    lines = [(a, b) for a, b in zip(before.splitlines(), after.splitlines(), strict=True) if a != b]
    assert len(lines) == 1
    old, new = lines[0]
    quote = b"'" if b"offset='" in old else b'"'
    head, tail = old.split(b"offset=" + quote)[0], old.rsplit(quote, 1)[1]
    assert new.startswith(head + b"offset=" + quote)
    assert new.endswith(quote + tail)
    tools = {tool.number: tool for tool in read_controller_files({"default.installation": content}).tools}
    near(parse_pose("ur", tools[name].pose), TOOL, "ur")
    again, _ = export(SESSION, results(), "ur", settings={"tool": name}, backup=content)
    assert again == content


def test_numbers_that_are_none_are_told_and_may_be_replaced() -> None:
    broken = installation(offset="0, 0, 100, 0, 0, 0")
    found = read_controller_files({"default.installation": broken})
    assert [(row.line, "millimetres" in row.reason) for row in found.skipped] == [(5, True)]
    content, _ = export(SESSION, results(), "ur", settings={"tool": "Greifer"}, backup=broken)
    assert len(read_controller_files({"default.installation": content}).tools) == 2
    with pytest.raises(InputError, match="Greifer, Sänner"):
        export(SESSION, results(), "ur", backup=broken)


def test_the_header_of_a_packed_file_stays() -> None:
    plain = b"<Installation/>" * 50
    body = gzip.compress(plain)[10:]
    header = b"\x1f\x8b\x08\x1e" + b"\x01\x02\x03\x04\x02\x03" + b"\x02\x00ab" + b"default\0" + b"note\0" + b"\0\0"
    header = header[:-2] + (zlib.crc32(header[:-2]) & 0xFFFF).to_bytes(2, "little")
    assert gzip.decompress(header + body) == plain
    new = gzipped_as(header + body, plain + b" ")
    assert new.startswith(header)
    assert gzip.decompress(new) == plain + b" "
