"""ABB: Externally Guided Motion, its position stream received alone (`EGMStreamStart`); nothing is sent.

Pose and external axes are those of the tool and work object that `EGMSetupUC` or the stream's start names.
"""

from typing import Any

from pydantic import Field

from calib_core.errors import InputError
from calib_core.robots import parse_pose
from server.sources.device import Description, Sample, host_now_s
from server.sources.pose_settings import Port, ToolAndFrame, axis_number, flange_by_joints, flange_of
from server.sources.source import Source

_WAIT_S = 0.5
_MS = 0.001


class AbbEgmSettings(ToolAndFrame):
    """The port of this computer that the controller's UDPUC device names.

    `robot` is the controller's address: messages of others are left out.  `table_axis` E1 is the first external
    axis.
    """

    port: Port = 6510
    robot: str | None = Field(default=None, max_length=64)
    table_axis: str | None = Field(default=None, pattern=r"^E[1-6]$")


class AbbEgm:
    """Receives the feedback of each cycle; the controller's clock is the device's time."""

    def __init__(self, settings: AbbEgmSettings) -> None:
        from ABBRobotEGM import EGM

        self._settings = settings
        self._stream: Any = EGM(port=settings.port)

    def describe(self) -> Description:
        """Return what the controller sends."""
        can = ("pose", "joints", "device time", *(("table",) if self._settings.table_axis else ()))
        return Description("ABB EGM", "mm, degrees", "abb", "active tool in active work object", can)

    def read(self) -> Sample | None:
        """Return the next message as a sample; raises InputError where it holds no pose."""
        from google.protobuf.message import DecodeError

        try:
            found, state = self._stream.receive_from_robot(_WAIT_S)
        except DecodeError:
            raise InputError("a message of EGM", "something else", "Let the controller alone send here.") from None
        if not found:
            return None
        chosen = self._settings
        if chosen.robot is not None and self._stream.egm_addr[0] != chosen.robot:
            return None
        joints = tuple(float(joint) for joint in state.joint_angles)
        pose = None
        if chosen.arm:
            pose = flange_by_joints(chosen.arm, joints)
        elif state.cartesian is not None:
            place, turn = state.cartesian.pos, state.cartesian.orient
            told = parse_pose("abb", [place.x, place.y, place.z, turn.u0, turn.u1, turn.u2, turn.u3])
            pose = flange_of(chosen, "abb", told)
        table_deg = axis_number(chosen.table_axis, [float(axis) for axis in state.external_axes])
        return Sample(host_now_s(), state.header.tm * _MS, pose, joints or None, table_deg)

    def close(self) -> None:
        """Close the port."""
        self._stream.close()


SOURCE = Source(
    "abb-egm",
    "ABB: EGM",
    "Receives the robot's pose, joints and external axes by Externally Guided Motion; sends nothing.",
    AbbEgmSettings,
    connect=AbbEgm,
    delivers=("robot", "table"),
    extra="egm",
    clock="every-reading",
)
