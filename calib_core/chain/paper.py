"""The paper's two steps, beside the joint answer: on the same captures, with its sides and the sphere's size."""

from dataclasses import replace

import numpy as np

from calib_core.cell.walk import Position
from calib_core.chain.answer import Answer, answer_of
from calib_core.chain.held import Held
from calib_core.chain.model import ChainState
from calib_core.chain.observations import Observations, SphereSize
from calib_core.chain.rejection import Judged
from calib_core.chain.scanner import COUNT, corrected
from calib_core.chain.two_step import TwoStepAnswer, two_step, without_capture
from calib_core.chain.two_step_covariance import two_step_covariance
from calib_core.frames import FloatArray
from calib_core.messages import message

_MOST_LEFT_OUT = 60


def by_paper(
    observations: Observations, sphere: SphereSize, judged: Judged, held: Held, sides: np.ndarray
) -> tuple[Answer | None, TwoStepAnswer, tuple[FloatArray, FloatArray] | None]:
    """Return the paper's method on the used captures, its sides and the sphere's size those of the joint answer.

    Of a long session only some captures, evenly spread, are left out in turn: each time all is solved again.
    """
    state = held.state
    if judged.data.walk.layout.axes:
        why = message("an axis moved that carries the robot or the sphere")
        return None, TwoStepAnswer(None, None, None, (), why), None
    sphere = SphereSize(2 * state.radius_mm, sphere.sigma_mm)
    used = np.flatnonzero(judged.used & (judged.data.walk.scanner == 0) & (judged.data.walk.place == 0)).tolist()
    rotations, translations = judged.data.rotations[used], judged.data.translations[used]
    centers = np.array([observations[k].sphere_center_in_laser_mm(sphere, int(sides[k])) for k in used])
    answer = two_step(rotations, translations, centers)
    own_groups = answer.groups
    groups = tuple(tuple(used[i] for i in group) for group in own_groups)
    answer = TwoStepAnswer(answer.rotation, answer.translation, answer.center, groups, answer.reason)
    found = _paper_state(answer, state)
    if found is None:
        return None, answer, None
    left_out: list[ChainState | None] = [None] * len(observations)
    for n in np.unique(np.linspace(0, len(used) - 1, min(len(used), _MOST_LEFT_OUT)).astype(int)).tolist():
        rest = np.arange(len(used)) != n
        left_out[used[n]] = _paper_state(
            two_step(rotations[rest], translations[rest], centers[rest], without_capture(own_groups, n)), state
        )
    some, walk = [observations[k] for k in used], judged.data.walk.chosen(np.array(used))
    by_files = _by_files(some, sphere, sides[used], centers, held)
    covariance = two_step_covariance(some, sphere, centers, rotations, translations, judged.fit, walk, by_files)
    return answer_of(observations, judged.used, sides, found, left_out, judged.data), answer, covariance


def _by_files(
    observations: Observations, sphere: SphereSize, sides: np.ndarray, centers: FloatArray, held: Held
) -> list[tuple[FloatArray, FloatArray]]:
    """Return how centres (K, 3) and joint answer (6,) move with one sigma of each error of the first scanner."""
    own, first = held.nuisances_of(0), len(held.covariance) - len(held.active)
    own = own[held.data.of_files[held.active[own]]]
    spread = held.covariance[np.ix_(first + own, first + own)]
    values, vectors = np.linalg.eigh(spread)
    found: list[tuple[FloatArray, FloatArray]] = []
    for step in (vectors * np.sqrt(np.maximum(values, 0.0))).T:
        errors = np.zeros(COUNT)
        errors[held.data.kinds[held.active[own]]] = step
        right = [corrected(one, errors, held.half_width_mm) for one in observations]
        pairs = zip(right, sides.tolist(), strict=True)
        moved = np.array([one.sphere_center_in_laser_mm(sphere, side) for one, side in pairs]) - centers
        found.append((moved, held.covariance[:6, first + own] @ np.linalg.pinv(spread) @ step))
    return found


def _paper_state(answer: TwoStepAnswer, joint: ChainState) -> ChainState | None:
    if answer.rotation is None or answer.translation is None or answer.center is None:
        return None
    at = joint.position
    place = Position(
        np.array([answer.rotation, *at.mount_rotations[1:]]),
        np.array([answer.translation, *at.mount_translations[1:]]),
        np.array([answer.center, *at.places[1:]]),
        at.axes,
    )
    return replace(joint, position=place)
