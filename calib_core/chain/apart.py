"""How several scanners stand to each other, which is known far better than where each of them is.

What robots do to both cancels, so points decide.  A scanner's scale, shear and bow bend its arcs: in its files
neighbouring points then err alike, few count as independent, and an answer for such files is right to be cautious.
Once the errors that were found are out of them, the same points say all that their noise leaves.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.chain_data import ChainData
from calib_core.chain.likelihood import fit, spheres_of, without_scanner_errors
from calib_core.chain.model import ChainState
from calib_core.chain.rejection import Judged
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray


@dataclass(frozen=True, eq=False)
class Straight:
    """The answer by points without their scanners' errors.

    `covariance` (P, P) is its own, `in_files` that of the same captures with their points as files have them.
    """

    state: ChainState
    covariance: FloatArray
    in_files: FloatArray


def straight_of(judged: Judged) -> Straight | None:
    """Return the answer by points without errors; None where there is one scanner, or none bends its arcs."""
    data, found = judged.data, judged.fit
    if len(data.walk.layout.mounts) == 1 or (data.bent == 1).all():
        return None
    straight = fit(_without_errors(data, found.state), found.state, found.sigmas)
    if not straight.converged:
        return None
    own, in_files = (
        judged.inflation * covariance_of(one.at.hessian)[: data.width, : data.width]
        for one in (straight, found.minimum)
    )
    return Straight(straight.state, own, in_files)


def _without_errors(data: ChainData, state: ChainState) -> ChainData:
    """Return captures whose points count by how they lie about their balls as a state sees them."""
    points, shifts = without_scanner_errors(data, state)
    radii, _ = spheres_of(data, state)
    many = np.diff(data.offsets)
    each = np.repeat(np.arange(data.count), many)
    distances = np.linalg.norm(points - state.centers_in_laser[each], axis=1) - radii[each] - shifts
    squares, counts = (np.bincount(each, of, data.count) for of in (data.counts * distances**2, data.counts))
    scatter = squares / np.maximum(counts, 1) * many / np.maximum(many - 3, 1)
    weights = data.weights * data.bent
    return replace(data, weights=weights, effective=weights * scatter)
