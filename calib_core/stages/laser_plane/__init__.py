"""The plane of laser light, from frames of the board with the stripe on it."""

from typing import TYPE_CHECKING, ClassVar

from calib_core.graph.stage import FRAME_FIELDS, Stage
from calib_core.steps import CaptureStep

if TYPE_CHECKING:
    from calib_core.records import GuideNow, Session
    from calib_core.records.laser_plane_result import LaserPlaneResult
    from calib_core.stages.guide import GuideView


class LaserPlane(Stage):
    """The plane of laser light, from frames of the board with the stripe on it."""

    name, title, place = "laser-plane", "Laser plane", 20
    method_revision = 12  # a board left out widens no ±; one that scatters as the others do is not left out
    step = CaptureStep(
        "laser-plane",
        "Laser plane",
        "board",
        "Capture the board with the stripe on it, near and far, and add the frames to the session.",
        least=2,
        letter="l",
    )
    takes: ClassVar = {"laser-plane": FRAME_FIELDS}
    reads = ("board",)
    known = ("laser_plane",)
    after = ("camera",)
    guided = ("laser-plane",)
    frames: ClassVar = {"camera_from_laser": "covariance"}
    layers = ("laser_plane",)

    @property
    def result(self) -> "type[LaserPlaneResult]":
        """The record of its result, which captures of raw frames need too."""
        from calib_core.records.laser_plane_result import LaserPlaneResult

        return LaserPlaneResult

    def is_wanted(self, session: "Session") -> bool:
        """Return whether the scanner delivers raw frames."""
        from calib_core.captures.raw_frames import uses_frames

        return uses_frames(session)

    def guide(self, view: "GuideView") -> "GuideNow | None":
        """Return what to do now for it, None where it asks for nothing."""
        from calib_core.stages.camera.guide import laser_plane_now

        return laser_plane_now(view)


STAGE = LaserPlane()
