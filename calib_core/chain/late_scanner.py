"""Where a scanner is that saw balls on axes alone, by axes and places that other scanners found.

Where its balls are, seen from what carries it, is known then, so that three of its profiles, each ball on either
side of the plane of light, fix its mount; the guess on which most captures agree wins.  Balls in one plane, as
those of one height on a table, look the same to a scanner that is mirrored at it: such a scanner is not placed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from calib_core.cell.layout import Layout
from calib_core.cell.walk import Position
from calib_core.chain.arrays import chain_data
from calib_core.chain.axes_balls import middle_of_arcs
from calib_core.chain.axes_start import moved_back
from calib_core.chain.observations import SphereSize, TableObservation
from calib_core.chain.rejection import core_of
from calib_core.chain.spread import AGREE_MM, robust_costs
from calib_core.chain.turntable import TurntableSolution
from calib_core.frames import FloatArray, RigidTransform, nearest_rotation

_TRIPLES, _KEPT, _STEPS = 120, 24, 12
_LEAST = 4
_FAR_MM = 5.0
_OTHER_RAD, _OTHER_MM = 0.02, 2.0
_RIVAL, _RIVAL_MM = 3.0, 0.3


@dataclass(frozen=True, eq=False)
class LateScanner:
    """A scanner's mount R (3, 3), T (3,), its captures and which of these agree, places of balls it alone saw."""

    rotation: FloatArray
    translation: FloatArray
    observations: list[TableObservation]
    core: np.ndarray
    places: FloatArray

    @property
    def mount(self) -> RigidTransform:
        """Where it is on what carries it."""
        return RigidTransform(
            RigidTransform.of(self.rotation, self.translation, "base", "laser").matrix,
            self.observations[0].placed.carriers.scanner,
            "laser",
        )


def late_scanner(
    observations: Sequence[TableObservation], sphere: SphereSize, table: TurntableSolution
) -> LateScanner | str:
    """Return where one scanner is by its captures of balls on axes, or why it cannot be told.

    That is "nothing-common" where it saw no ball of the others', "one-height" where it may be mirrored, and
    "no-agreement" where its captures fit nowhere.
    """
    placed, layout, at = [o.placed for o in observations], table.state.walk.layout, table.state.position
    own = dict.fromkeys((o.carriers.ball, o.ball) for o in placed)
    alone = [place for place in own if place not in layout.places]
    layout = Layout(((placed[0].scanner, placed[0].carriers.scanner),), (*layout.places, *alone), layout.axes)
    places = np.concatenate([at.places, np.zeros((len(alone), 3))])
    at = Position(np.eye(3)[None], np.zeros((1, 3)), places, at.axes)
    walk = chain_data(placed, sphere, None, layout=layout).walk
    common = walk.place < len(places) - len(alone)
    if common.sum() < _LEAST:
        return "nothing-common"
    sides = [[o.sphere_center_in_laser_mm(sphere, o.side or side) for side in (1, -1)] for o in placed]
    seen, expected = np.array(sides), walk.seen(at)
    found = _best(seen[common], expected[common])
    if isinstance(found, str):
        return found
    rotation, translation = found
    carried, first = seen @ rotation.T + translation, len(places) - len(alone)
    in_base = np.einsum("kij,ksj->ksi", walk.rotations, carried) + walk.translations[:, None]
    back = moved_back(walk, np.where((walk.over_robot > 0)[:, None, None], in_base, carried), at)
    for n in range(first, len(places)):
        places[n] = middle_of_arcs(back[walk.place == n])
    misfit = np.linalg.norm(carried - walk.seen(at)[:, None], axis=2).min(axis=1)
    return LateScanner(rotation, translation, [*observations], core_of(misfit), places[first:])


def _best(seen: FloatArray, expected: FloatArray) -> tuple[FloatArray, FloatArray] | str:
    """Return the mount that brings balls' possible centres in L (K, 2, 3) to where they are (K, 3)."""
    rng, count = np.random.default_rng(len(seen)), len(seen)
    triples = np.array([rng.choice(count, 3, replace=False) for _ in range(_TRIPLES)])
    some = np.array(list(product((0, 1), repeat=3)))
    points = seen[triples[:, None], some].reshape(-1, 3, 3)
    there = np.repeat(expected[triples], len(some), axis=0)
    rotations, translations = _rigid(points, there, np.ones((len(points), 3)))
    costs = robust_costs(_off(seen, expected, rotations, translations)[0])
    best = np.argsort(costs)[:_KEPT]
    rotations, translations = rotations[best], translations[best]
    for _ in range(_STEPS):
        off, side = _off(seen, expected, rotations, translations)
        weight = 1 / (1 + (off / np.maximum(3 * np.median(off, axis=1), AGREE_MM)[:, None]) ** 2)
        own = seen[np.arange(count), side]
        rotations, translations = _rigid(own, np.broadcast_to(expected, own.shape), weight)
    scatter = np.median(_off(seen, expected, rotations, translations)[0], axis=1)
    order = np.argsort(scatter)
    rotation, translation, least = rotations[order[0]], translations[order[0]], float(scatter[order[0]])
    if least > _FAR_MM:
        return "no-agreement"
    turned = np.linalg.norm((rotations - rotation).reshape(-1, 9), axis=1) / np.sqrt(2)
    apart = (turned > _OTHER_RAD) | (np.linalg.norm(translations - translation, axis=1) > _OTHER_MM)
    if apart.any() and scatter[apart].min() < _RIVAL * least + _RIVAL_MM:
        return "one-height"
    return rotation, translation


def _off(
    seen: FloatArray, expected: FloatArray, rotations: FloatArray, translations: FloatArray
) -> tuple[FloatArray, np.ndarray]:
    """Return how far balls (K) are off by mounts (N), (N, K), on the side that is nearer, and which that is."""
    carried = np.einsum("nij,ksj->nksi", rotations, seen) + translations[:, None, None]
    apart = np.linalg.norm(carried - expected[None, :, None], axis=3)
    return apart.min(axis=2), np.argmin(apart, axis=2)


def _rigid(points: FloatArray, there: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the motions that bring points (N, K, 3) to others best, with weights (N, K)."""
    share = (weight / weight.sum(axis=1, keepdims=True))[:, :, None]
    middle, other = (share * points).sum(axis=1), (share * there).sum(axis=1)
    rotations = nearest_rotation(
        np.einsum("nki,nkj->nij", share * (there - other[:, None]), points - middle[:, None])
    )
    return rotations, other - np.einsum("nij,nj->ni", rotations, middle)
