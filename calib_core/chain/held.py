"""The answer for the scanner's files as they are: their errors of scale, shear and bow stay in them.

Whoever uses the tool with uncorrected files is best served by the tool that such files gave: it has swallowed what
is wrong with them, and at the distance of the captures both cancel.  So unless the errors are to be applied, tool
and sphere are solved once more without them, while the covariance stays that of the whole model.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.apart import Straight, straight_of
from calib_core.chain.arm_errors import ArmErrors
from calib_core.chain.arm_lengths import ArmLengths, arm_lengths_error
from calib_core.chain.chain_data import ChainData, Sigmas
from calib_core.chain.likelihood import ChainLinearisation, fit, linearised_at
from calib_core.chain.model import ChainState
from calib_core.chain.rejection import Judged
from calib_core.chain.scanner import COUNT, NAMES, incidence_shapes
from calib_core.chain.without_turns import without_exact
from calib_core.frames import FloatArray, skew

_CHANCE_EACH = 0.8  # of χ² for each unknown: errors that are alike over some captures alone stay below

_SIGNIFICANT = 4.0
# Real arcs are bent by some tenths of a per cent for other reasons; scanners that are wrong are wrong by more.
_WORTH_SAYING = {"scale_x": 0.005, "scale_z": 0.005, "shear": 0.01, "bow": 0.01}
_CHANCE = 9.49  # χ² of four, 95 %


@dataclass(frozen=True)
class ScannerError:
    """A significant error: lengths are to be multiplied by 1 + error (scale), x gains error · z (shear)."""

    name: str
    error: float
    sigma: float


@dataclass(frozen=True, eq=False)
class Held:
    """What the answer is about, and what was found of the scanner.

    Attributes
    ----------
    state, at
        The answer, and the likelihood about it.
    found : ChainState
        The same with the scanner's errors as they were found.
    active : (n,)
        Which nuisances were sought (`scanner.NAMES`).
    covariance : (P, P)
        Of the unknowns and the nuisances.
    facing : {1, -1}
        +1 where z grows away from the scanner.
    applied : bool
        Whether the scanner's errors are taken out of the points.
    errors : list of ScannerError
        Those that are significant, the arm's length scale among them.
    data, sigmas : ChainData, Sigmas
        What the answer was found from.
    half_width_mm : float
        Half the width that the scanner's points fill.
    arm : ArmErrors or None
        How the unknowns and the nuisances err together with the arm.
    left : (P,) or None
        By how much they are off, as far as that is known: for errors of the scanner that were found and stay in
        its files, with what the poses as told take back of it. Its square is in the covariance.
    by_lengths : (P,) or None
        What lengths of the arm that are off do to the unknowns. Its square is in the covariance.
    by_poses : (P,) or None
        What errors of the arm that captures share did to the unknowns (`chain.held_poses`). The same, as a part
        of `left` where there is one: errors that stay in the files look like the arm's until these are held.
    with_lengths : (P,) or None
        Covariance with the share by which the arm's lengths are off, where the scanner's errors are sought.
    straight : Straight or None
        Of several scanners, the answer by points without the scanners' errors.
    """

    state: ChainState
    at: ChainLinearisation
    found: ChainState
    active: np.ndarray
    covariance: FloatArray
    facing: int
    applied: bool
    errors: list[ScannerError]
    data: ChainData
    sigmas: Sigmas
    half_width_mm: float = 1.0
    arm: ArmErrors | None = None
    left: FloatArray | None = None
    by_lengths: FloatArray | None = None
    by_poses: FloatArray | None = None
    with_lengths: FloatArray | None = None
    straight: Straight | None = None

    @property
    def lengths_sigma(self) -> float:
        """Of the arm's lengths, as a share, as is believed of them."""
        return self.data.arm_scale_sigma

    def by_motions(self, seen_in_laser_mm: FloatArray) -> FloatArray:
        """Return the covariance of the tool (6, 6) by the motions: an arm that is off is no missing motion.

        A scanner that stands still may stand metres away: its shift is that of what it sees.
        """
        by_arm = np.outer(self.known_off, self.known_off) - np.outer(self._by_files, self._by_files)
        if self.by_lengths is not None:
            by_arm = by_arm + np.outer(self.by_lengths, self.by_lengths)
        every = self.covariance - by_arm
        found = every[:6, :6].copy()
        if self.state.walk.layout.mounts[0][1] != "tool0":
            rows, some = self._rows_at(seen_in_laser_mm, self.half_width_mm), self.tool_and_scanner
            found[3:], found[:, 3:] = 0.0, 0.0
            found[3:, 3:] = rows @ every[np.ix_(some, some)] @ rows.T
        return found

    @property
    def known_off(self) -> FloatArray:
        """By how much the unknowns (P,) are off for files and poses as they are; the covariance has its square."""
        known = self.by_poses if self.left is None else self.left
        return np.zeros(len(self.covariance)) if known is None else known

    @property
    def _by_files(self) -> FloatArray:
        return self.known_off if self.by_poses is None else self.known_off - self.by_poses

    @property
    def tool_and_scanner(self) -> np.ndarray:
        """The columns of the covariance that are of the first mount and of its scanner's nuisances."""
        return self.columns_of(0)

    def columns_of(self, scanner: int) -> np.ndarray:
        """Return the columns of the covariance that are of a scanner's mount and of its nuisances."""
        first = len(self.covariance) - len(self.active)
        mount = self.state.walk.layout.mount(scanner)
        return np.concatenate([np.arange(mount.start, mount.stop), first + self.nuisances_of(scanner)])

    def nuisances_of(self, scanner: int) -> np.ndarray:
        """Return which of `active` are a scanner's, or its ball's."""
        return np.flatnonzero(np.isin(self.active, self.nuisance_row(scanner)))

    def nuisance_row(self, scanner: int) -> np.ndarray:
        """Return which nuisances a scanner's eight are."""
        return self.data.nuisance_of[int(np.argmax(self.data.walk.scanner == scanner))]

    @property
    def mounts_and_scanners(self) -> np.ndarray:
        """The columns of the covariance that are of all mounts and of all nuisances."""
        size = len(self.covariance)
        mounts = self.state.walk.layout.of_mounts
        return np.concatenate([mounts, np.arange(size - len(self.active), size)])

    def at_point(self, point_in_laser_mm: FloatArray, half_width_mm: float) -> FloatArray:
        """Return the covariance (3, 3), mm², along the flange's axes, of a point that the scanner measures.

        The scanner's own errors count together with what they did to the tool: they largely cancel.
        """
        rows, some = self._rows_at(point_in_laser_mm, half_width_mm), self.tool_and_scanner
        # An answer whose points are corrected errs by what is unknown of the correction, one whose points are not
        # by the whole error: the same covariance, about another mean.
        return rows @ self.covariance[np.ix_(some, some)] @ rows.T

    def at_workpiece(self, point_in_laser_mm: FloatArray, half_width_mm: float) -> FloatArray:
        """Return the same in base as the arm tells it, (3, 3), mm².

        An arm whose lengths are off tells the flange as much too far from the point as it made the tool long.  The
        lengths that were found, and the step to the tool of the poses as told, are of one cause.
        """
        found, shared = self.at_point(point_in_laser_mm, half_width_mm), self.found.shared
        if self.with_lengths is None or shared is None or self.state.walk.layout.mounts[0][1] != "tool0":
            return found
        rows, some = self._rows_at(point_in_laser_mm, half_width_mm), self.tool_and_scanner
        way = self.lengths_sigma * self.state.mount(0).apply(point_in_laser_mm)
        swallowed = rows @ self.with_lengths[some] / self.lengths_sigma
        step = rows @ self.known_off[some]
        variances, axes = np.linalg.eigh(found - np.outer(step, step) - np.outer(swallowed, swallowed))
        left, offset = swallowed - way, step - shared[0] * way
        return (axes * np.maximum(variances, 0.0)) @ axes.T + np.outer(left, left) + np.outer(offset, offset)

    def _rows_at(self, point_in_laser_mm: FloatArray, half_width_mm: float) -> FloatArray:
        """Return how a measured point moves with the first mount and its scanner's nuisances, (3, 6 + n)."""
        rows = point_rows(self.state.tool_rotation, point_in_laser_mm, half_width_mm, self.facing)
        return rows[:, np.concatenate([np.arange(6), 6 + self.active[self.active < COUNT]])]


def point_rows(
    rotation: FloatArray, point_in_laser_mm: FloatArray, half_width_mm: float, facing: int
) -> FloatArray:
    """Return how a measured point moves along the flange's axes with the tool (6) and every nuisance, (3, 14)."""
    x, _, z = point_in_laser_mm
    moves = np.zeros((3, len(NAMES)))
    moves[0, 1], moves[2, 2], moves[0, 3], moves[2, 4] = x, z, z, x**2 / half_width_mm
    moves[2, 5:] = facing * incidence_shapes(np.ones(1))[0]  # a surface that the light meets straight on
    return np.hstack([-rotation @ skew(point_in_laser_mm), np.eye(3), rotation @ moves])


def hold_files(judged: Judged, apply: bool) -> Held:
    """Return the answer of captures that were judged, for corrected files or for files as they are."""
    lengths = arm_lengths_error(judged)
    held = _with_poses_as_told(_held(judged, apply, lengths))
    if lengths is not None:
        by_lengths = _off(lengths.state, held.state, held.active, len(held.covariance))
        more = held.covariance + np.outer(by_lengths, by_lengths)
        held = replace(held, covariance=more, by_lengths=by_lengths)
    covariance = without_exact(judged.data, held.covariance)
    arm, sought = _arm(judged, held.applied), judged.fit.arm
    return replace(
        held,
        covariance=covariance,
        half_width_mm=judged.data.half_width_mm,
        arm=arm,
        straight=straight_of(judged),
        with_lengths=None if sought is None or held.lengths_sigma <= 0 else judged.inflation * sought.with_lengths,
    )


def _with_poses_as_told(held: Held) -> Held:
    told = as_told(held.data, held.state, held.sigmas)
    if told is None:
        return held
    state, step = told
    by_poses = np.zeros(len(held.covariance))
    by_poses[: len(step)] = step
    before = held.known_off
    off = before + by_poses
    return replace(
        held,
        state=state,
        at=linearised_at(held.data, state, held.sigmas),
        covariance=held.covariance + np.outer(off, off) - np.outer(before, before),
        left=None if held.left is None else off,
        by_poses=by_poses,
    )


def _arm(judged: Judged, applied: bool) -> ArmErrors | None:
    """Return how the answer errs together with the arm."""
    arm, data = judged.fit.arm, judged.data
    if arm is None:
        return None
    arm = arm.of(judged.inflation * np.eye(data.width))
    of_files = data.of_files[data.active]
    if applied or not of_files.any():
        return arm
    return arm.held_at(judged.fit.covariance, data.unknowns + np.flatnonzero(of_files))


def _held(judged: Judged, apply: bool, lengths: ArmLengths | None) -> Held:
    found, at, data = judged.fit.state, judged.fit.minimum.at, judged.data
    active, given = data.active, (data, judged.fit.sigmas)
    covariance = judged.fit.covariance * judged.inflation
    heights = data.points[:, 2] - np.repeat(found.centers_in_laser[:, 2], np.diff(data.offsets))
    facing = -1 if len(heights) and heights.mean() > 0 else 1
    of_files = np.flatnonzero(data.of_files & (data.nuisance_sigmas > 0))
    if len(of_files) == 0:
        return Held(found, at, found, active, covariance, facing, apply, _with_arm(lengths, []), *given)
    surprise, errors = _surprise(judged, covariance, of_files)
    errors = _with_arm(lengths, errors)
    if apply:
        return Held(found, at, found, active, covariance, facing, True, errors, *given)
    exact = replace(data, nuisance_sigmas=np.where(data.of_files, 0.0, data.nuisance_sigmas))
    if data.tool_prior is not None:
        exact = replace(exact, tool_prior=data.tool_prior.without(data.of_files[active]))
    values = np.where(data.of_files, 0.0, found.scanner)
    answer = fit(exact, replace(found, scanner=values), judged.fit.sigmas)
    shift = _off(found, replace(answer.state, scanner=values), active, len(covariance))
    covariance = covariance + surprise * np.outer(shift, shift)
    return Held(
        answer.state,
        answer.at,
        found,
        active,
        covariance,
        facing,
        False,
        errors,
        exact,
        judged.fit.sigmas,
        left=np.sqrt(surprise) * shift if surprise > 0 else None,
    )


def _surprise(judged: Judged, covariance: FloatArray, of_files: np.ndarray) -> tuple[float, list[ScannerError]]:
    """Return how surely the files' errors are not nothing, 0 … 1, and those that are significant one by one.

    One whose own 95 % interval holds zero is no accusation: few captures, and rims that err, give some that are
    beyond chance alone.

    Were they nothing, what is found of them would have the covariance C − C P C, P their priors' information.  Of
    a squared length χ² the share 1 − c / χ² is more than chance (after James and Stein, who take the mean of
    χ² for c; its 95 % leaves right scanners alone).
    """
    data, size = judged.data, len(covariance)
    columns = size - len(data.active) + np.searchsorted(data.active, of_files)
    own = covariance[np.ix_(columns, columns)]
    scale = data.nuisance_sigmas[of_files]
    posterior = own / np.outer(scale, scale)
    by_chance = posterior - posterior @ posterior
    found = judged.fit.state.scanner[of_files] / scale
    values, vectors = np.linalg.eigh((by_chance + by_chance.T) / 2)
    square = float(np.sum((vectors.T @ found) ** 2 / np.maximum(values, 1e-4)))
    errors: list[ScannerError] = []
    for n, index in enumerate(of_files):
        error, name = float(found[n] * scale[n]), NAMES[data.kinds[index]]
        chance = float(scale[n] * np.sqrt(max(by_chance[n, n], 1e-6)))
        sigma = float(np.sqrt(own[n, n]))
        if abs(error) > max(_SIGNIFICANT * chance, 2 * sigma, _WORTH_SAYING[name]):
            errors.append(ScannerError(name, error, sigma))
    return max(0.0, 1 - _CHANCE / max(square, 1e-12)), errors


def _off(truth: ChainState, answer: ChainState, active: np.ndarray, size: int) -> FloatArray:
    """Return by how much all unknowns (size,) of an answer are off if another state is true."""
    row = np.zeros(size)
    step = truth.step_to(answer)
    row[: len(step)] = step
    row[size - len(active) :] = (answer.scanner - truth.scanner)[active]
    return row


def _with_arm(lengths: ArmLengths | None, errors: list[ScannerError]) -> list[ScannerError]:
    """Return errors with the arm's where they may be its lengths' as well as the scanner's."""
    if lengths is None:
        return errors
    arm = ScannerError("arm_scale", lengths.share, lengths.sigma)
    return [arm, *(e for e in errors if e.name not in ("scale_x", "scale_z"))]


def as_told(data: ChainData, state: ChainState, sigmas: Sigmas) -> tuple[ChainState, FloatArray] | None:
    """Return the answer that is best with the poses as told, and the step (P,) to it; None where it is this one.

    Parameters
    ----------
    data : ChainData
    state : ChainState
        The most likely one, in which captures share errors of the arm.
    sigmas : Sigmas
    """
    if not sigmas.is_alike:
        return None
    own = Sigmas(
        float(np.hypot(sigmas.position_mm, sigmas.alike_position_mm)),
        float(np.hypot(sigmas.orientation_rad, sigmas.alike_orientation_rad)),
        sigmas.axes,
    )
    alone, begin = replace(data, arm_scale_sigma=0.0, drift_sigma_mm=0.0), replace(state, shared=None)
    best = fit(alone, begin, own)
    gained = 2 * (linearised_at(alone, begin, own).cost - best.at.cost)
    share = 1 - (_CHANCE_EACH * data.free_unknowns / max(gained, 1e-12)) ** 4
    if share <= 0 or not best.converged:
        return None
    step = share * state.step_to(best.state)
    scanner = state.scanner + share * (best.state.scanner - state.scanner)
    shared = state.shared
    if data.arm_means is not None and shared is not None and best.state.shared is not None:
        many, shared = len(data.arm_means), shared.copy()  # the arm's own errors move along
        shared[-many:] += share * (best.state.shared[-many:] - shared[-many:])
    position = state.position.moved(data.walk.layout, step)
    return replace(state, position=position, scanner=scanner, shared=shared), step
