"""The arm's own errors from the captures that the tool was solved from: which members, how large, worth it or not.

About the answer everything is linear: where a capture sees its ball, against where answer and pose expect it, is
the edges' unknowns (nothing believed of them), the arm's terms (`arms.errors`, each believed to be small, how
small by its member's own scale), errors that are alike where poses are alike, and the pose's own.  The scales
follow from the restricted likelihood.  A member that the likelihood does not miss is left out.  The likelihood
decides whether the model is worth it, unless poses that it has not seen contradict: groups of neighbours are left
out in turn, with the answer that is best without it.  Of few captures these poses hardly tell, and a right arm's
likelihood hardly rises, however few there are.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from calib_core.arms.alike import alike_correlation
from calib_core.arms.errors import MEMBERS, ArmTerm, Member
from calib_core.chain.chain_data import ChainData, Sigmas
from calib_core.chain.likelihood import linearised_at
from calib_core.chain.model import ChainState, prediction
from calib_core.chain.noise import NoiseShapes
from calib_core.chain.observations import Observations
from calib_core.estimation import maximum
from calib_core.frames import FloatArray

_MOST_CAPTURES = 60  # scales and held-out errors are known well enough from so many
_MOST_SOLVED = 200
_OPEN_MM = 100.0  # a capture knows its ball's centre at least so well, in every direction
_TELLING_MM = 0.3  # directions in which it is known less do not count for held-out errors
_GAIN = 1.0  # of a log-likelihood: right arms' rises by 0.1
_MISSED = 0.5
_OWN = (0.05, 3.0, 0.003, 50.0)  # mm: mean, factor, least, largest of an arm's repeatability
_ALIKE = (0.1, 2.5, 0.005, 50.0)  # mm: of what the terms leave
_SCALE = (1.0, 2.0, 0.05, 20.0)  # of a member's terms, in what is believed of them
_TURN_A_MM = 2e-3  # rad: an arm's errors of orientation beside those of position


@dataclass(frozen=True, eq=False)
class ArmInput:
    """What is known of the arm: its terms, and how each capture's flange moves with them, (K, 6, p)."""

    terms: tuple[ArmTerm, ...]
    moves: FloatArray


@dataclass(frozen=True, eq=False)
class ArmTold:
    """What the captures alone tell of all terms, whatever edges and members: information (p, p) and its vector.

    Of terms in units of what is believed of them; `vector` (p,) is the information times the likeliest values.
    """

    terms: tuple[ArmTerm, ...]
    information: FloatArray
    vector: FloatArray


@dataclass(frozen=True, eq=False)
class ArmModel:
    """The arm's errors as the captures tell them.

    Attributes
    ----------
    terms : tuple of ArmTerm
        Of the members that are used; `sigma` is what is believed of each, by these captures' scales.
    kept : (p,) int
        Which of the input's terms they are.
    values, covariance : (p,), (p, p)
    told : ArmTold
    held_out_mm : (float, float)
        RMS error of the ball's place at poses left out, without and with the model.
    gain : float
        By how much the captures are likelier with it: a difference of log-likelihoods.
    decided_by : {"held-out", "likelihood"}
        The likelihood where poses left out differ by less than the standard deviation of that.
    worth_it, applied : bool
        Whether other poses are predicted better with it; whether the answer is of poses corrected by it.
    """

    terms: tuple[ArmTerm, ...]
    kept: np.ndarray
    values: FloatArray
    covariance: FloatArray
    told: ArmTold
    held_out_mm: tuple[float, float]
    gain: float
    decided_by: Literal["held-out", "likelihood"]
    worth_it: bool
    applied: bool = False

    @property
    def members(self) -> tuple[Member, ...]:
        """The members that are used."""
        return tuple(name for name in MEMBERS if any(term.member == name for term in self.terms))

    @property
    def sigmas(self) -> FloatArray:
        """Standard deviations (p,) of the values."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


def arm_input(observations: Observations, terms: Sequence[ArmTerm]) -> ArmInput | None:
    """Return what is known of the arm; None where joints of some captures are not."""
    moves = [one.arm_moves for one in observations if one.arm_moves is not None]
    return ArmInput(tuple(terms), np.array(moves)) if terms and len(moves) == len(observations) else None


def arm_model_of(data: ChainData, state: ChainState, sigmas: Sigmas, used: np.ndarray, arm: ArmInput) -> ArmModel:
    """Return the arm's errors by captures whose answer was found.

    Parameters
    ----------
    data, state, sigmas
        What the answer was found from, and the answer.
    used : (K,) bool
    arm : ArmInput
    """
    some = _spread(np.flatnonzero(used), _MOST_CAPTURES)
    problem = _Problem.of(data, state, sigmas, arm, some)
    without = problem.fitted([])
    every: list[Member] = [name for name in MEMBERS if problem.has(name)]
    fitted = problem.fitted(every)
    for name in reversed(every):
        trial = problem.without(fitted, name)
        if trial.density > fitted.density - _MISSED:
            fitted = trial
    *held, fall = problem.held_out(without, fitted)
    gain = fitted.density - without.density
    likelier = bool(fitted.members) and gain > _GAIN
    by = "held-out" if likelier and abs(fall) > 1.0 else "likelihood"
    worth = likelier and fall > -1.0
    enough = problem if used.sum() == len(some) else _Problem.of(
        data, state, sigmas, arm, _spread(np.flatnonzero(used), _MOST_SOLVED)
    )  # fmt: skip
    kept = np.flatnonzero([term.member in fitted.members for term in arm.terms])
    told = enough.told(fitted)
    believed = np.array([arm.terms[n].sigma for n in kept])
    values, covariance, scales = enough.terms_of(fitted, kept, believed, told)
    terms = tuple(replace(arm.terms[n], sigma=float(s)) for n, s in zip(kept, scales, strict=True))
    return ArmModel(
        terms, kept, values, covariance, ArmTold(arm.terms, *told), (held[0], held[1]), gain, by, worth
    )


def arm_columns(data: ChainData, state: ChainState, arm: ArmInput, some: np.ndarray) -> FloatArray:
    """Return how some captures' balls are expected elsewhere in L with each term, (k, 3, p)."""
    walk, at = data.walk.chosen(some), state.position
    moves = walk.moves(walk.laser_from_base(at), walk.levers(at, walk.seen(at)))
    moves[:, :, :3] *= -1  # a reported position that lies off: the true one is on the other side
    return np.asarray(moves @ arm.moves[some])


@dataclass(frozen=True, eq=False)
class _Fitted:
    members: list[Member]
    logarithms: FloatArray
    density: float


@dataclass(frozen=True, eq=False)
class _Problem:
    """Some captures as one linear problem: off (3k,) = edges · x + terms · θ + noise of covariance parts."""

    off: FloatArray
    edges: FloatArray
    terms: FloatArray
    of_member: list[str]
    fixed: FloatArray
    own: FloatArray
    alike: FloatArray
    alone: FloatArray
    groups: np.ndarray
    telling: FloatArray

    @classmethod
    def of(cls, data: ChainData, state: ChainState, sigmas: Sigmas, arm: ArmInput, some: np.ndarray) -> "_Problem":
        mask = np.zeros(data.count, dtype=bool)
        mask[some] = True
        columns = arm_columns(data, state, arm, some) * [term.sigma for term in arm.terms]
        data = data.chosen(mask)
        state = replace(state, centers_in_laser=state.centers_in_laser[mask], shared=None, active=data.active)
        at = linearised_at(data, state, replace(sigmas, alike_position_mm=0.0, alike_orientation_rad=0.0))
        known = at.information[:, :3, :3]
        noise = np.asarray(np.linalg.inv(known + np.eye(3) / _OPEN_MM**2), dtype=float)
        measured = np.einsum("kij,kj->ki", noise, at.vector[:, :3])
        off = (measured - at.offset).ravel()
        count = len(some)
        expected = prediction(data, state)
        shapes = NoiseShapes.at(
            data, expected.centers_in_laser, state, expected.levers, data.walk.translations.mean(axis=0)
        )
        nuisances = -(noise @ at.information[:, :3, 3:]) * data.nuisance_sigmas[data.active]
        fixed = _blocks(noise) + _together(nuisances)
        for sigma, axis in zip(sigmas.axes, shapes.axes, strict=False):
            fixed += _blocks(shapes.scale * sigma**2 * axis[:, :, None] * axis[:, None, :])
        moves = shapes.moves * np.array([1.0, 1.0, 1.0, *[_TURN_A_MM] * 3])
        each = moves @ np.swapaxes(moves, 1, 2)
        correlation = alike_correlation(data.walk.poses, 1.0)
        among = np.einsum("kia,lja->kilj", moves, moves) * correlation[:, None, :, None]
        weight = np.linalg.inv(noise)
        return cls(
            off,
            expected.jacobian[:, :, ~data.held].reshape(3 * count, -1),
            columns.reshape(3 * count, -1),
            [term.member for term in arm.terms],
            fixed,
            _blocks(shapes.scale * each),
            among.reshape(3 * count, 3 * count),
            _blocks(each),
            _neighbours(*data.walk.poses),
            weight @ np.linalg.inv(weight + np.eye(3) / _TELLING_MM**2),
        )

    def has(self, member: str) -> bool:
        return member in self.of_member

    def fitted(self, members: Sequence[Member]) -> _Fitted:
        """Return the likeliest scales of some members."""
        mean, width, low, high = _believed(members)
        parts = self._parts(members)

        def density(x: FloatArray) -> float:
            away = (x - mean) / width
            return self._density(parts, x) - 0.5 * float(away @ away)

        x = maximum(density, mean.copy(), width, low, high, 0.05)
        return _Fitted(list(members), x, density(x))

    def without(self, fitted: _Fitted, name: Member) -> _Fitted:
        """Return a fit without one of its members, the other scales as they are."""
        members: list[Member] = [one for one in fitted.members if one != name]
        some = np.array([True, True, *(one != name for one in fitted.members)])
        return _Fitted(members, fitted.logarithms[some], self._posterior(members, fitted.logarithms[some]))

    def _posterior(self, members: Sequence[Member], logarithms: FloatArray) -> float:
        mean, width, _, _ = _believed(members)
        away = (logarithms - mean) / width
        return self._density(self._parts(members), logarithms) - 0.5 * float(away @ away)

    def _parts(self, members: Sequence[Member]) -> list[FloatArray]:
        own = [self.terms[:, [m == name for m in self.of_member]] for name in members]
        return [self.own, self.alike, *(part @ part.T for part in own)]

    def covariance(self, parts: Sequence[FloatArray], logarithms: FloatArray) -> FloatArray:
        found = self.fixed.copy()
        for part, logarithm in zip(parts, logarithms, strict=True):
            found += np.exp(2 * logarithm) * part
        return found

    def _density(self, parts: Sequence[FloatArray], logarithms: FloatArray) -> float:
        from scipy.linalg import solve_triangular

        low = np.linalg.cholesky(self.covariance(parts, logarithms))
        both = solve_triangular(low, np.column_stack([self.edges, self.off]), lower=True, check_finite=False)
        edges, off = both[:, :-1], both[:, -1]
        triangle = np.linalg.qr(edges, mode="r")
        along = np.linalg.lstsq(edges, off, rcond=None)[0]
        rest = off - edges @ along
        sizes = np.abs(np.diag(triangle))
        return float(-0.5 * rest @ rest - np.log(np.diag(low)).sum() - np.log(sizes[sizes > 1e-12]).sum())

    def solved(self, covariance: FloatArray, terms: FloatArray, rows: np.ndarray) -> tuple[FloatArray, FloatArray]:
        """Return edges and terms by some rows, the terms believed to be of unit size, and their covariance."""
        design = np.column_stack([self.edges, terms])[rows]
        weighed = np.linalg.solve(covariance[np.ix_(rows, rows)], design)
        hessian = design.T @ weighed
        size = self.edges.shape[1]
        hessian[np.arange(size, len(hessian)), np.arange(size, len(hessian))] += 1.0
        scale = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
        inverse = np.linalg.pinv(hessian / np.outer(scale, scale), rcond=1e-12, hermitian=True)
        inverse /= np.outer(scale, scale)
        return inverse @ (weighed.T @ self.off[rows]), np.asarray(inverse, dtype=float)

    def terms_of(
        self, fitted: _Fitted, kept: np.ndarray, sigmas: FloatArray, told: tuple[FloatArray, FloatArray]
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return values, covariance and believed sizes of terms, in their own units, by what is told of them."""
        own = self.scales(fitted)[kept]
        information = told[0][np.ix_(kept, kept)] * np.outer(own, own) + np.eye(len(kept))
        inverse, scales = np.linalg.inv(information), own * sigmas
        return inverse @ (own * told[1][kept]) * scales, inverse * np.outer(scales, scales), scales

    def told(self, fitted: _Fitted) -> tuple[FloatArray, FloatArray]:
        """Return information (p, p) on all terms and its vector (p,), the edges being whatever they are."""
        covariance = self.covariance([self.own, self.alike], fitted.logarithms[:2])
        every = np.column_stack([self.edges, self.terms, self.off])
        square, size = every.T @ np.linalg.solve(covariance, every), self.edges.shape[1]
        scale = np.sqrt(np.maximum(np.diag(square)[:size], 1e-300))
        back = np.linalg.pinv(square[:size, :size] / np.outer(scale, scale), rcond=1e-12, hermitian=True)
        left = square[size:, size:] - square[size:, :size] @ (back / np.outer(scale, scale)) @ square[:size, size:]
        return left[:-1, :-1], left[:-1, -1]

    def scales(self, fitted: _Fitted) -> FloatArray:
        by_name: dict[str, float] = dict(zip(fitted.members, np.exp(fitted.logarithms[2:]), strict=True))
        return np.array([by_name.get(name, 0.0) for name in self.of_member])

    def scaled(self, fitted: _Fitted) -> FloatArray:
        return self.terms * self.scales(fitted)

    def held_out(self, without: _Fitted, fitted: _Fitted) -> tuple[float, float, float]:
        """Return the RMS error at groups of poses left out, without the model and with it, and how sure it falls.

        The last is the fall of squares in its own standard deviations, by how groups differ in it.
        """
        own, alike = np.exp(2 * without.logarithms[:2])
        plain = self.fixed + own * self.own + alike * self.alone
        whole = self.covariance([self.own, self.alike], fitted.logarithms[:2])
        terms = self.scaled(fitted)
        none = terms[:, :0]
        before, after = self._left_out(plain, none), self._left_out(whole, terms)
        count, falls = len(self.groups), before - after
        sure = float(falls.sum() / max(np.sqrt(len(falls)) * falls.std(ddof=1), 1e-12))
        return float(np.sqrt(before.sum() / count)), float(np.sqrt(after.sum() / count)), sure

    def _left_out(self, covariance: FloatArray, terms: FloatArray) -> FloatArray:
        """Return the squares of each group's errors, summed."""
        totals, design = list[float](), np.column_stack([self.edges, terms])
        for group in range(self.groups.max() + 1):
            out = np.repeat(self.groups == group, 3)
            found, _ = self.solved(covariance, terms, np.flatnonzero(~out))
            rest = (self.off[out] - design[out] @ found).reshape(-1, 3)
            totals.append(float(np.einsum("ki,kij,kj->", rest, self.telling[self.groups == group], rest)))
        return np.array(totals)


def _believed(members: Sequence[Member]) -> FloatArray:
    """Return mean, width, least and largest (4, n) of logarithms: own and alike errors, members' scales."""
    return np.log(np.array([_OWN, _ALIKE, *[_SCALE] * len(members)])).T


def _spread(some: np.ndarray, most: int) -> np.ndarray:
    """Return at most so many, evenly spread."""
    return some if len(some) <= most else some[np.linspace(0, len(some) - 1, most).astype(int)]


def _blocks(each: FloatArray) -> FloatArray:
    """Return a matrix (3k, 3k) of blocks (k, 3, 3) on its diagonal."""
    count = len(each)
    found = np.zeros((count, 3, count, 3))
    found[np.arange(count), :, np.arange(count), :] = each
    return found.reshape(3 * count, 3 * count)


def _together(columns: FloatArray) -> FloatArray:
    rows = columns.reshape(len(columns) * 3, -1)
    return np.asarray(rows @ rows.T)


def _neighbours(rotations: FloatArray, translations: FloatArray) -> np.ndarray:
    """Return poses in up to six groups of neighbours, (k,): the farthest ones first, all others to the nearest."""
    count = len(rotations)
    correlation = alike_correlation((rotations, translations), 1.0)
    middle = [int(np.argmin(correlation.sum(axis=0)))]
    while len(middle) < min(6, max(3, count // 4)):
        middle.append(int(np.argmin(correlation[:, middle].max(axis=1))))
    groups, most = np.full(count, -1), -(-count // len(middle))
    # Groups of about one size: the surest member of any group that has room comes next.
    order = np.argsort(-correlation[:, middle], axis=None)
    for k, group in zip(*np.unravel_index(order, (count, len(middle))), strict=True):
        if groups[k] < 0 and np.sum(groups == group) < most:
            groups[k] = group
    return groups
