"""What scanners that stand still cannot tell of axes before them: on which side of their planes of light they are.

Every place of a ball, mirrored at the plane of light, moves about the mirrored axis as the ball moves about the
true one, and gives the same profiles.  Where one fixed scanner alone sees an axis, both answers are as likely; of
several, whose planes of light may nearly be one, all captures say how likely the other one is.  The stated
covariance has room for it, unless the sense in which the axis counts tells them apart.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib_core.cell.layout import AxisState, Layout, MovedAxis
from calib_core.cell.walk import Position, Walk
from calib_core.chain.chain_data import ChainData
from calib_core.chain.encoder_scales import EncoderScales
from calib_core.chain.likelihood import fit
from calib_core.chain.model import ChainState
from calib_core.chain.observations import TABLE, Observations
from calib_core.chain.rejection import Judged
from calib_core.chain.table_frame import LEVEL
from calib_core.chain.variance import ChainFit, is_settled
from calib_core.frames import FloatArray, with_third

_HOPELESS = 12.0  # log-likelihood
_PLAUSIBLE_MM = 2.0  # captures that scatter more fit neither way
_LIKELIER = 0.5  # log-likelihood: less is no reason to change sides
_REACH_MM = 100.0  # from the axis to what stands before the scanner
_TOLD = 2 * _HOPELESS  # log-likelihood: of the sense in which an axis counts, as told


@dataclass(frozen=True, eq=False)
class MirrorImage:
    """An answer on the other side of a plane of light.

    Attributes
    ----------
    state : ChainState
    log_odds : float
        By how much (natural logarithm) it is likelier.
    lean_rad, apart_mm : float
        How far at most an axis leans from its own one, and a ball at readings of zero lies from its own place.
    by_sense : bool
        Whether the sense in which axes count, which is not told, would tell them apart.
    """

    state: ChainState
    log_odds: float
    lean_rad: float
    apart_mm: float
    by_sense: bool

    @property
    def chance(self) -> float:
        """How likely it is beside the answer."""
        return float(1 / (1 + np.exp(-self.log_odds)))


JudgedTable = tuple[Judged, EncoderScales]


def told_directions(axes: Sequence[MovedAxis], of_table: int | None) -> dict[str, int]:
    """Return the senses in which axes count, by their names, as far as they are told."""
    told = {TABLE: of_table, **{axis.name: axis.direction for axis in axes}}
    return {name: direction for name, direction in told.items() if direction is not None}


def likelier_side(
    observations: Observations,
    start: ChainState,
    core: np.ndarray,
    judge: Callable[[ChainState, np.ndarray], JudgedTable],
    directions: Mapping[str, int],
) -> tuple[JudgedTable, MirrorImage | None]:
    """Return captures judged from a start and a core of them, or from its mirror image; and the other image."""
    judged = judge(start, core)
    image = mirror_image(observations, judged[0].data, judged[0].fit, directions)
    for _ in start.walk.layout.places:  # each ball alone may be on the other side
        if image is None or image.log_odds < _LIKELIER:
            break
        judged = judge(image.state, judged[0].used)
        image = mirror_image(observations, judged[0].data, judged[0].fit, directions)
    return judged, image


def mirror_image(
    observations: Observations, data: ChainData, found: ChainFit, directions: Mapping[str, int]
) -> MirrorImage | None:
    """Return the likeliest mirror image of a fit, of those that are not likelier the one that would change most.

    None where captures, or what is told, leave no doubt.

    Parameters
    ----------
    observations, data
        All captures, and the same as arrays.
    found : ChainFit
    directions : mapping
        The senses in which axes count, as far as they are told.
    """
    walk = data.walk
    riding: np.ndarray = np.any(walk.layout.rides[walk.place], axis=1)
    if not riding.any() or walk.over_robot[riding].any() or found.sigmas.largest_position_mm > _PLAUSIBLE_MM:
        return None
    told_side = np.array([o.kind != "profile" or o.side is not None for o in observations])
    images: list[MirrorImage] = []
    for scanner, balls in _sides_to_try(walk, riding, told_side):
        image = _mirrored(data, found.state, scanner, balls)
        senses, own = _senses(image), _senses(found.state)
        told = sum((senses.get(name, 0) - own.get(name, 0)) * way for name, way in directions.items())
        if told < 0:
            continue
        there = fit(data, image, found.sigmas)
        if is_settled(replace(found, minimum=there)):  # of one that ran away no cost means anything
            flips = any(senses.get(name) == -way for name, way in own.items())
            log_odds = found.minimum.at.cost - there.at.cost + (_TOLD if told else 0.0)
            apart = _apart(found.state.position, there.state.position, walk.layout)
            images.append(MirrorImage(there.state, log_odds, *apart, by_sense=flips))
    plausible = [one for one in images if one.log_odds >= -_HOPELESS]
    likelier = [one for one in plausible if one.log_odds >= _LIKELIER]
    if likelier:
        return max(likelier, key=lambda one: one.log_odds)
    return max(plausible, key=lambda one: one.chance * (one.apart_mm + _REACH_MM * one.lean_rad), default=None)


def _sides_to_try(
    walk: Walk, riding: np.ndarray, told_side: np.ndarray
) -> Iterator[tuple[int, Sequence[int] | None]]:
    """Give a scanner and the balls that its plane of light may mirror: all with their axes, None, or one alone.

    A ball with a capture whose side is told stays, and all axes then too; one alone is mirrored by who sees it.
    """
    seen: list[tuple[int, int]] = np.unique(np.column_stack([walk.scanner, walk.place])[riding], axis=0).tolist()
    sided = {int(n) for n in walk.place[riding & told_side]}
    several = len({n for _, n in seen}) > 1
    for scanner in sorted({scanner for scanner, _ in seen}):
        if not sided:
            yield scanner, None
        yield from ((scanner, [n]) for by, n in seen if several and by == scanner and n not in sided)


def _senses(state: ChainState) -> dict[str, int]:
    """Return in which sense rotary axes count that are not level, by their names."""
    edges = zip(state.walk.layout.axes, state.position.axes, strict=True)
    ups = {edge.name: axis.rotation[2, 2] for edge, axis in edges if edge.kind == "rotary"}
    return {name: 1 if up > 0 else -1 for name, up in ups.items() if abs(up) > LEVEL}


def _mirrored(data: ChainData, state: ChainState, scanner: int, balls: Sequence[int] | None) -> ChainState:
    """Return axes under the object and their balls mirrored at a scanner's plane of light, or some balls alone."""
    layout, at = state.walk.layout, state.position
    normal, origin = at.mount_rotations[scanner][:, 1], at.mount_translations[scanner]
    mirror = np.eye(3) - 2 * np.outer(normal, normal)
    axes, places = list(at.axes), at.places.copy()
    for a in layout.carrying:
        axis, rotary = at.axes[a], layout.axes[a].kind == "rotary"
        z = mirror @ axis.rotation[:, 2] * (-1 if rotary else 1)  # a mirrored turn counts the other way
        point = mirror @ (axis.origin - origin) + origin
        if balls is None:
            axes[a] = AxisState(with_third(z), point if rotary else axis.origin, axis.scale)
        for n in layout.on_axis(a):
            if balls is not None and n not in balls:
                continue
            there = mirror @ (_in_base(at, layout, n, a) - origin) + origin
            places[n] = (there - axes[a].origin) @ axes[a].rotation if rotary else there
    return ChainState.at(data, replace(at, places=places, axes=tuple(axes)))


def _apart(at: Position, there: Position, layout: Layout) -> tuple[float, float]:
    """Return how far at most axes lean from those of another answer, rad, and balls lie from theirs, mm."""
    lean_rad = apart_mm = 0.0
    for a in layout.carrying:
        one, other = at.axes[a].rotation[:, 2], there.axes[a].rotation[:, 2]
        lean_rad = max(lean_rad, float(np.arcsin(min(1.0, np.linalg.norm(np.cross(one, other))))))
        for n in layout.on_axis(a):
            apart_mm = max(
                apart_mm, float(np.linalg.norm(_in_base(there, layout, n, a) - _in_base(at, layout, n, a)))
            )
    return lean_rad, apart_mm


def _in_base(at: Position, layout: Layout, place: int, axis: int) -> FloatArray:
    """Return where a ball on an axis is in base at readings of zero."""
    own = at.axes[axis]
    rotary = layout.axes[axis].kind == "rotary"
    return own.rotation @ at.places[place] + own.origin if rotary else at.places[place]


def mirror_spread(data: ChainData, state: ChainState, image: MirrorImage | None) -> FloatArray:
    """Return what a mirror image adds to the covariance of the edges' unknowns, (P, P)."""
    layout, step = data.walk.layout, np.zeros(data.unknowns)
    if image is None:
        return np.outer(step, step)
    at, mirrored = state.position, image.state.position
    for a in layout.carrying:
        axis, there = at.axes[a], mirrored.axes[a]
        rotary = layout.axes[a].kind == "rotary"
        z, other = axis.rotation[:, 2], there.rotation[:, 2]
        other = other if other @ z > 0 else -other
        turn, shift = axis.rotation.T @ np.cross(z, other), np.zeros(3)
        if rotary:
            across = there.origin - axis.origin
            shift[:2] = (axis.rotation.T @ (across - other * (other @ across)))[:2]
        columns = layout.axis(a).start
        step[columns : columns + 4] = [*turn[:2], *shift[:2]]
        for n in layout.on_axis(a):
            off = _in_base(mirrored, layout, n, a) - _in_base(at, layout, n, a)
            own = axis.rotation.T @ off - np.cross(turn, at.places[n]) - shift
            step[layout.place(n)] = own if rotary else off
    step[data.held] = 0.0
    return image.chance * np.outer(step, step)


def with_spread(covariance: FloatArray, spread: FloatArray) -> FloatArray:
    """Return the covariance of the edges' unknowns, and of nuisances behind them, with a spread of the former."""
    found, size = covariance.copy(), len(spread)
    found[:size, :size] += spread
    return found
