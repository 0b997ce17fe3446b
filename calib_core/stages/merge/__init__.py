"""All scans in one frame."""

from typing import TYPE_CHECKING, ClassVar

from calib_core.cell.found import known_scanner, own_base
from calib_core.graph.stage import SCAN_FIELDS, Stage
from calib_core.stages.raw_frames import rests_on_optics
from calib_core.steps import CaptureStep

if TYPE_CHECKING:
    from calib_core.records import Session


class Merge(Stage):
    """All scans in one frame."""

    name, title, place = "merge", "Merged cloud", 70
    method_revision = 14  # a surface whose place is open has no ±
    step = CaptureStep(
        "scan",
        "Scan",
        "object",
        "Scan the object from around, with the robot's pose and the table's angle of each scan.",
        letter="s",
    )
    takes: ClassVar = {"scan": (*SCAN_FIELDS, "table_deg")}
    reads = (
        "pose_convention", "scanner.point_sigma_mm", "scanner.z_axis", "scanners", "robot.arm", "arrangement",
        "robot.errors", "axes", "known.frames",
        "merge.voxel_mm", "merge.mesh", "merge.registration", "merge.self_calibration", "merge.memory_mb",
        "merge.holes", "merge.mesh_tolerance_mm", "merge.reference", "merge.alignment", "merge.tolerance_mm",
    )  # fmt: skip
    after = ("camera", "laser-plane", "tcp", "turntable", "chain")
    guided = ("scan", "merge")
    settings_field = "merge"
    layers = ("merged", "scans")

    def rests_on(self, session: "Session") -> tuple[str, ...]:
        """Return where tool and table come from, and what turns raw frames into points."""
        known = session.cell.known
        optics = rests_on_optics(session, self.takes)
        if known.base_from_turntable is None and self._turns(session):
            apart = known_scanner(session.cell) or own_base(session.cell, session.captures)
            return (*optics, "chain") if apart is None else (*optics, "tcp", "turntable")
        return (*optics, "tcp") if known.base_from_turntable is None else (*optics, "tcp", "turntable")

    def reads_of_cell(self, session: "Session") -> tuple[str, ...]:
        """Return the cell's fields that it reads: what no solved stage gives, it takes from the cell."""
        known, reads = session.cell.known, self.reads
        if known.base_from_turntable is not None:
            reads = (*reads, "turntable.direction", "turntable.angle_sigma_deg")
        if known_scanner(session.cell) is not None and (known.base_from_turntable or not self._turns(session)):
            reads = (*reads, "robot.position_sigma_mm", "robot.orientation_sigma_deg")
        return reads

    def files_of_cell(self, session: "Session") -> tuple[str, ...]:
        """Return the nominal part's file, where one is told."""
        reference = session.cell.merge.reference
        return () if reference is None else (reference,)

    @staticmethod
    def _turns(session: "Session") -> bool:
        """Return whether the table is to be solved."""
        return any(capture.step == "turntable" and not capture.excluded for capture in session.captures)


STAGE = Merge()
