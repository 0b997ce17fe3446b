"""Arms known by their names: nominal lengths, each with where they stand in public."""

from collections.abc import Sequence

import numpy as np

from calib_core.frames import with_third
from calib_core.records import ArmJoint, ArmTable

_UR = "Universal Robots: DH parameters for calculations of kinematics and dynamics"
_ROS_INDUSTRIAL = "ros-industrial/{}, the frames base and tool0 of its description"
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_FORWARD = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])  # z to the front, x up

_UR_ALPHA_DEG = (90.0, 0.0, 0.0, 90.0, -90.0, 0.0)


def _ur(a2_mm: float, a3_mm: float, d1_mm: float, d4_mm: float, d5_mm: float, d6_mm: float) -> ArmTable:
    """Return an arm of Universal Robots' layout by the lengths that its maker publishes."""
    lengths = [(0.0, d1_mm), (a2_mm, 0.0), (a3_mm, 0.0), (0.0, d4_mm), (0.0, d5_mm), (0.0, d6_mm)]
    return ArmTable(
        joints=[
            ArmJoint(a_mm=a, d_mm=d, alpha_deg=alpha) for (a, d), alpha in zip(lengths, _UR_ALPHA_DEG, strict=True)
        ],
        source=_UR,
    )


def _abb(d1_mm: float, a1_mm: float, a2_mm: float, a3_mm: float, d4_mm: float, d6_mm: float) -> ArmTable:
    """Return an arm of six joints with a wrist whose axes meet, as ABB counts: at zero the forearm lies flat."""
    rows = [
        (a1_mm, -90.0, d1_mm, 0.0), (a2_mm, 0.0, 0.0, -90.0), (a3_mm, -90.0, 0.0, 0.0),
        (0.0, 90.0, d4_mm, 0.0), (0.0, -90.0, 0.0, 0.0), (0.0, 0.0, d6_mm, 180.0),
    ]  # fmt: skip
    joints = [ArmJoint(a_mm=a, alpha_deg=turn, d_mm=d, theta_deg=zero) for a, turn, d, zero in rows]
    return ArmTable(joints=joints, source=_ROS_INDUSTRIAL.format("abb"))


def _kuka(d1_mm: float, a1_mm: float, a2_mm: float, a3_mm: float, d4_mm: float, d6_mm: float) -> ArmTable:
    """Return such an arm as KUKA counts: stretched out at zero, axes 1, 4 and 6 the other way."""
    alike = _abb(d1_mm, a1_mm, a2_mm, a3_mm, d4_mm, d6_mm)
    changes = [{"sign": -1}, {"theta_deg": 0.0}, {"theta_deg": -90.0}, {"sign": -1}, {}, {"sign": -1}]
    joints = [joint.model_copy(update=own) for joint, own in zip(alike.joints, changes, strict=True)]
    return alike.model_copy(update={"joints": joints, "source": _ROS_INDUSTRIAL.format("kuka_experimental")})


def _chain(
    steps: Sequence[tuple[float, float, float, str]],
    flange: np.ndarray,
    source: str,
    couples: dict[int, int] | None = None,
) -> ArmTable:
    """Return an arm by where each axis stands from the one before, x y z, with all joints at zero, and its axis.

    The last step is the flange's, its orientation given beside.
    """
    joints: list[ArmJoint] = []
    last, place = np.eye(3), np.eye(4)
    for x, y, z, axis in steps:
        turned = (
            flange
            if axis == "flange"
            else with_third(np.array(_AXES[axis[-1]]) * (-1.0 if axis[0] == "-" else 1.0))
        )
        place = np.eye(4)
        place[:3, :3], place[:3, 3] = last.T @ turned, last.T @ np.array([x, y, z])
        if axis != "flange":
            joints.append(ArmJoint(previous_from_joint=place.tolist()))
            last = turned
    return ArmTable(joints=joints, last_from_tool0=place.tolist(), couples=couples or {}, source=source)


def _forearm_forward(
    a1_mm: float, a2_mm: float, a3_mm: float, d4_mm: float, d6_mm: float, source: str
) -> ArmTable:
    """Return an arm whose forearm points to the front at zero, as FANUC and Yaskawa count, from axis 2 on."""
    steps = [
        (0.0, 0.0, 0.0, "z"), (a1_mm, 0.0, 0.0, "y"), (0.0, 0.0, a2_mm, "-y"), (0.0, 0.0, a3_mm, "-x"),
        (d4_mm, 0.0, 0.0, "-y"), (0.0, 0.0, 0.0, "-x"), (d6_mm, 0.0, 0.0, "flange"),
    ]  # fmt: skip
    # FANUC counts the third joint from the horizontal: it moves along with the second.
    couples = {2: 1} if source.endswith("fanuc") else None
    return _chain(steps, _FORWARD, _ROS_INDUSTRIAL.format(source), couples)


def _straight_up(a1_mm: float, beside_mm: float, a2_mm: float, d4_mm: float, d6_mm: float) -> ArmTable:
    """Return an arm that stands straight up at zero, as Stäubli counts."""
    steps = [
        (0.0, 0.0, 0.0, "z"), (a1_mm, 0.0, 0.0, "y"), (0.0, beside_mm, a2_mm, "y"), (0.0, 0.0, 0.0, "z"),
        (0.0, 0.0, d4_mm, "y"), (0.0, 0.0, 0.0, "z"), (0.0, 0.0, d6_mm, "flange"),
    ]  # fmt: skip
    return _chain(steps, np.eye(3), _ROS_INDUSTRIAL.format("staubli_experimental"))


_DENSO = "DENSORobot/denso_robot_ros2, vs060: from its base_link to its J6"
_KAWASAKI = "Kawasaki-Robotics/khi_robot, khi_rs_description: from its base_link to its link6"


def _kawasaki(a2_mm: float, d4_mm: float) -> ArmTable:
    steps = [
        (0.0, 0.0, 360.0, "-z"), (0.0, 0.0, 0.0, "-x"), (0.0, 0.0, a2_mm, "x"), (0.0, 0.0, 92.5, "z"),
        (0.0, 0.0, d4_mm, "x"), (0.0, 0.0, 78.0, "z"), (0.0, 0.0, 0.0, "flange"),
    ]  # fmt: skip
    return _chain(steps, np.eye(3), _KAWASAKI)


NAMED_ARMS: dict[str, ArmTable] = {
    "ur3e": _ur(-243.55, -213.2, 151.85, 131.05, 85.35, 92.1),
    "ur5": _ur(-425.0, -392.25, 89.159, 109.15, 94.65, 82.3),
    "ur5e": _ur(-425.0, -392.2, 162.5, 133.3, 99.7, 99.6),
    "ur10e": _ur(-612.7, -571.55, 180.7, 174.15, 119.85, 116.55),
    "ur16e": _ur(-478.4, -360.0, 180.7, 174.15, 119.85, 116.55),
    "ur20": _ur(-862.0, -728.7, 236.3, 201.0, 159.3, 154.3),
    "irb120": _abb(290.0, 0.0, 270.0, 70.0, 302.0, 72.0),
    "irb1200-7/0.7": _abb(399.1, 0.0, 350.0, 42.0, 351.0, 82.0),
    "irb1600-6/1.2": _abb(486.5, 150.0, 475.0, 0.0, 600.0, 65.0),
    "irb2600-12/1.65": _abb(445.0, 150.0, 700.0, 115.0, 795.0, 85.0),
    "irb4600-60/2.05": _abb(495.0, 175.0, 900.0, 175.0, 960.0, 135.0),
    "kr6-r900-sixx": _kuka(400.0, 25.0, 455.0, 35.0, 420.0, 80.0),
    "kr10-r1100-sixx": _kuka(400.0, 25.0, 560.0, 35.0, 515.0, 80.0),
    "kr16-2": _kuka(675.0, 260.0, 680.0, -35.0, 670.0, 158.0),
    "lrmate-200id": _forearm_forward(50.0, 330.0, 35.0, 335.0, 80.0, "fanuc"),
    "m-10ia": _forearm_forward(150.0, 600.0, 200.0, 640.0, 100.0, "fanuc"),
    "m-20ia": _forearm_forward(150.0, 790.0, 250.0, 835.0, 100.0, "fanuc"),
    "m-710ic/50": _forearm_forward(150.0, 870.0, 170.0, 1016.0, 175.0, "fanuc"),
    "r-2000ic/165f": _forearm_forward(312.0, 1075.0, 225.0, 1280.0, 215.0, "fanuc"),
    "gp7": _forearm_forward(40.0, 445.0, 40.0, 440.0, 80.0, "motoman"),
    "gp8": _forearm_forward(40.0, 345.0, 40.0, 340.0, 80.0, "motoman"),
    "gp12": _forearm_forward(155.0, 614.0, 200.0, 640.0, 100.0, "motoman"),
    "gp25": _forearm_forward(150.0, 760.0, 200.0, 795.0, 100.0, "motoman"),
    "tx60": _straight_up(0.0, 20.0, 290.0, 310.0, 70.0),
    "tx2-60": _straight_up(0.0, 20.0, 290.0, 310.0, 70.0),
    "tx90": _straight_up(50.0, 50.0, 425.0, 425.0, 100.0),
    "vs060": _chain(
        [
            (0.0, 0.0, 181.5, "z"), (0.0, 0.0, 163.5, "y"), (0.0, 0.0, 305.0, "y"), (-10.0, 0.0, 164.5, "z"),
            (0.0, 0.0, 135.5, "y"), (0.0, 0.0, 70.0, "z"), (0.0, 0.0, 0.0, "flange"),
        ],
        np.eye(3),
        _DENSO,
    ),
    "rs007n": _kawasaki(355.0, 282.5),
    "rs007l": _kawasaki(455.0, 382.5),
}  # fmt: skip
