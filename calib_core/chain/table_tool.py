"""Whether the captures of the table see the scanner where those of the still sphere do.

The captures of the table tell the tool too.  Fitted with a tool that may be elsewhere, they tell how far and
whether chance explains it: a scanner that was moved on the flange in between, or another sphere.  Fitted with a
tool that may not, they only seem to scatter more, which hides it.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.held import Held
from calib_core.chain.likelihood import without_pose_errors
from calib_core.chain.model import off_known_tool
from calib_core.chain.rejection import Judged, estimated
from calib_core.chain.variance import fit_with_sigmas
from calib_core.estimation import covariance_of
from calib_core.findings import Finding
from calib_core.findings.codes.turntable import TOOL_MOVED
from calib_core.frames import FloatArray

_ELSEWHERE = np.array([0.02] * 3 + [5.0] * 3)  # rad and mm: as far as a tool may be that still sees the sphere
_TOLD_BY_TABLE = 0.5  # of what is not known of a direction: less says nothing of it
_RARE = 0.003


@dataclass(frozen=True, eq=False)
class ToolMove:
    """By how much the table's captures see the tool elsewhere, and how rare so much is by chance.

    Attributes
    ----------
    off : (6 + n,)
        Of tool and nuisances from where the still sphere's captures put them, rad and mm.
    chance : float
        How often so much comes of chance.
    share : float
        How much of its square is more than chance, 0 … 1: after James and Stein 1 − c / χ², c the mean of χ².
    """

    off: FloatArray
    chance: float
    share: float

    @property
    def shift_mm(self) -> float:
        """How far the tool seems shifted."""
        return float(np.linalg.norm(self.off[3:6]))

    @property
    def turn_rad(self) -> float:
        """By which angle it seems turned."""
        return float(np.linalg.norm(self.off[:3]))

    @property
    def finding(self) -> Finding | None:
        """What is noticed of it; None where chance explains it."""
        if self.chance >= _RARE:
            return None
        return TOOL_MOVED(shift_mm=self.shift_mm, turn_deg=float(np.rad2deg(self.turn_rad)))


def tool_move(judged: Judged) -> ToolMove | None:
    """Return how far captures of a table see the tool elsewhere than it is known to be; None where they cannot.

    Parameters
    ----------
    judged : Judged
        With what is known of tool and scanner as `data.tool_prior`.
    """
    data = judged.data
    if data.tool_prior is None:
        return None
    known = covariance_of(data.tool_prior.information)
    wide = known.copy()
    count = 6 * len(data.tool_prior.rotations)
    wide[range(count), range(count)] += np.tile(_ELSEWHERE, count // 6) ** 2
    information = covariance_of(wide)
    free = replace(data, tool_prior=replace(data.tool_prior, information=information))
    sigmas = estimated(judged.given) if judged.excess > 1 else judged.given  # what was told may not hold
    fitted = fit_with_sigmas(free, judged.fit.state, sigmas, judged.fit.sigmas)
    assert free.tool_prior is not None
    off = off_known_tool(free.tool_prior, fitted.state)
    some = data.known_columns
    left = covariance_of(fitted.minimum.at.hessian)[np.ix_(some, some)]
    squared, directions = _squared_distance(off[:count], known, wide, left)
    if directions == 0:
        return None
    freedom = max(3 * int(judged.used.sum()) - data.free_unknowns, 3)
    guessed = None in sigmas
    mean = directions * (freedom / (freedom - 2) if guessed else 1.0)
    share = max(0.0, 1 - mean / max(squared, 1e-12))
    return ToolMove(off, _chance(squared, directions, freedom, guessed), share)


def with_tool_move(held: Held, move: ToolMove | None, still: int) -> Held:
    """Return an answer of both kinds of captures whose table's covariance holds that the tool moved between them.

    Captures of the table whose sphere is expected elsewhere by J · off pull the answer by H⁻¹ Σ JᵀΛJ · off,
    those that share a stop the scanner's errors, too.  The tool's own covariance stays: of directions that neither
    kind of captures sees well, `off` is mostly noise, which the table does not follow.

    Parameters
    ----------
    held : Held
    move : ToolMove or None
    still : int
        How many captures of the still sphere come first.
    """
    if move is None or move.share == 0.0:
        return held
    at = held.at
    reduced, _ = without_pose_errors(at.information, at.vector, at.gain, at.share)
    jacobian, known = at.jacobian[still:], reduced[still:, :3, :3]
    layout = held.data.walk.layout
    moved = jacobian[:, :, layout.of_mounts] @ move.off[: len(layout.of_mounts)]
    pull = np.einsum("kip,kij,kj->p", jacobian, known, moved)
    together = held.data.stop[still:] >= 0  # their Λ is of points alone: the scanner's errors took up all of it
    pull[at.nuisances] += np.einsum("kni,ki->n", reduced[still:, 3:, :3][together], moved[together])
    table = layout.axis_and_places(layout.table)
    by_move = np.zeros(len(held.covariance))
    by_move[table] = np.sqrt(move.share) * (covariance_of(at.hessian) @ pull)[table]
    return replace(held, covariance=held.covariance + np.outer(by_move, by_move))


def _squared_distance(off: FloatArray, known: FloatArray, wide: FloatArray, left: FloatArray) -> tuple[float, int]:
    """Return χ² of where the captures moved the tool to, and in how many directions they can.

    From the prior they move it by G (x − m), with G = 1 − left · wide⁻¹ and x what they say alone, whose
    covariance is Λ⁻¹; were the tool where it is known to be, that had the covariance
    G · known · Gᵀ + left · Λ · left.
    """
    prior = covariance_of(wide)
    gain = np.eye(len(wide)) - left @ prior
    spread = gain @ known @ gain.T + gain @ left
    count = len(off)
    spread = ((spread + spread.T) / 2)[:count, :count]
    unit = np.linalg.inv(np.linalg.cholesky(wide[:count, :count]))
    told, vectors = np.linalg.eigh(np.eye(count) - unit @ left[:count, :count] @ unit.T)
    seen = (vectors[:, told > _TOLD_BY_TABLE]).T @ unit
    if len(seen) == 0:
        return 0.0, 0
    moved = seen @ off
    return float(moved @ np.linalg.solve(seen @ spread @ seen.T, moved)), len(seen)


def _chance(squared: float, directions: int, freedom: int, estimated: bool) -> float:
    from scipy.special import chdtrc, fdtrc  # scipy.stats has them too, but takes a second to import

    if estimated:
        return float(fdtrc(directions, freedom, squared / directions))
    return float(chdtrc(directions, squared))
