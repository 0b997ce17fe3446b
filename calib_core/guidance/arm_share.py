"""What the arm does to a measured point beside what it did to tool and table: its errors that scans share.

The arm erred in the calibration's captures as it errs where a workpiece is measured from poses like those, so that
tool and table have swallowed part of it: at the point that part cancels.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib_core.arms.alike import REACH_MM, alike_correlation, alike_weights
from calib_core.chain.model import Sigmas
from calib_core.frames import FloatArray, RigidTransform, skew
from calib_core.records.results import ArmErrorsFound


@dataclass(frozen=True, eq=False)
class ArmShare:
    """How tool, table and scanner err together with the arm.

    Attributes
    ----------
    rotations, translations : (m, 3, 3), (m, 3)
        Poses that stand for all, base_from_tool0.
    reach : float
        See `arms.alike`.
    middle_mm, lengths_sigma : (3,), float
        From where lengths are compared, and by what share they are off.
    with_lengths, with_poses : (12 + n,), (12 + n, m, 6)
        Covariances of tool, table and scanner's errors with the arm's: see `ArmErrorsFound`.
    """

    rotations: FloatArray
    translations: FloatArray
    reach: float
    middle_mm: FloatArray
    lengths_sigma: float
    with_lengths: FloatArray
    with_poses: FloatArray

    @classmethod
    def of(cls, result: Mapping[str, Any], with_scanner: bool, with_table: bool) -> "ArmShare | None":
        """Return what a result of `chain` or `tcp` has; None for one of before it was told."""
        if result.get("arm_errors") is None:
            return None
        found = ArmErrorsFound.model_validate(result["arm_errors"])
        poses = [RigidTransform.from_rounded(pose, "base", "tool0") for pose in found.poses]
        lengths, shares = [np.array(found.tool_with_lengths)], [_by_member(found.tool_with_poses)]
        if with_table and found.table_with_poses is not None and found.table_with_lengths is not None:
            lengths.append(np.array(found.table_with_lengths))
            shares.append(_by_member(found.table_with_poses))
        else:
            lengths.append(np.zeros(6))
            shares.append(np.zeros((6, len(poses), 6)))
        if with_scanner and found.scanner_with_lengths:
            lengths.append(np.array(found.scanner_with_lengths))
            shares.append(_by_member(found.scanner_with_poses))
        return cls(
            np.array([pose.rotation for pose in poses]).reshape(-1, 3, 3),
            np.array([pose.translation_mm for pose in poses]).reshape(-1, 3),
            float(result["variance_components"]["reach_mm"]) / REACH_MM,
            np.array(found.middle_mm),
            found.lengths_sigma,
            np.concatenate(lengths),
            np.concatenate(shares),
        )

    def with_answer(self, rotation: FloatArray, places_mm: FloatArray, arm_in_base_mm: FloatArray) -> FloatArray:
        """Return how tool, table and scanner err together with the arm at measured points, (P, 12 + n, 3).

        Parameters
        ----------
        rotation, places_mm : (3, 3), (P, 3)
            The flange's orientation and its places in base.
        arm_in_base_mm : (3,)
            From the flange to the point, along base's axes: so do the errors of the points.
        """
        found = np.einsum("p,qi->qpi", self.with_lengths, places_mm - self.middle_mm)
        if len(self.rotations) and self.reach > 0:
            turned = np.broadcast_to(rotation, (len(places_mm), 3, 3))
            known = self.rotations, self.translations
            weights = alike_weights(known, (turned, places_mm), self.reach)
            at_pose = np.einsum("qm,pmi->qpi", weights, self.with_poses)
            found = found + at_pose[:, :, :3] + at_pose[:, :, 3:] @ skew(arm_in_base_mm).T
        return found

    def by_lengths(self, places_mm: FloatArray) -> FloatArray:
        """Return the covariances (P, 3, 3), mm², that the arm's lengths put in where the flange stands."""
        away = places_mm - self.middle_mm
        return self.lengths_sigma**2 * away[:, :, None] * away[:, None, :]

    def explained(self, sigmas: Sigmas) -> FloatArray:
        """Return what of the covariance of tool, table and scanner, (12 + n, …), the arm's errors explain."""
        found = np.zeros((len(self.with_lengths), len(self.with_lengths)))
        if self.lengths_sigma > 0:
            found += np.outer(self.with_lengths, self.with_lengths) / self.lengths_sigma**2
        if len(self.rotations) and self.reach > 0:
            own = alike_correlation((self.rotations, self.translations), self.reach)
            sizes = np.array([sigmas.alike_position_mm] * 3 + [sigmas.alike_orientation_rad] * 3)
            scaled = np.moveaxis(self.with_poses / np.maximum(sizes, 1e-12), 1, 0)  # (m, 12 + n, 6)
            solved = np.linalg.solve(own, scaled.reshape(len(own), -1)).reshape(scaled.shape)
            found += np.einsum("mpi,mqi->pq", scaled, solved)
        return found


def _by_member(rows: list[list[list[float]]]) -> FloatArray:
    return np.moveaxis(np.array(rows, dtype=float), 0, 1)
