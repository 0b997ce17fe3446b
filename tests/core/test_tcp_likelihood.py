"""The joint likelihood against finite differences and against the same thing with every pose error written out."""

from dataclasses import replace

import numpy as np
import pytest

from calib_core.cell.layout import AxisState
from calib_core.cell.walk import Position
from calib_core.chain import arrays
from calib_core.chain.arrays import chain_data
from calib_core.chain.centers import fit_centers
from calib_core.chain.chain_data import ChainData, Sigmas
from calib_core.chain.likelihood import fit, linearise, retract
from calib_core.chain.model import ChainState
from calib_core.chain.noise import noise_of, pose_spread
from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.chain.scanner import ScannerPriors
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray, RigidTransform, rotation_from_vector

POINT_SIGMA_MM, CENTER_SIGMA_MM = 0.02, 0.03
SIGMAS = Sigmas(0.05, 2e-4)
RADIUS_MM = 20.0
TOOL = RigidTransform.of([0.3, -0.2, 1.4], [35.0, -120.0, 140.0], "tool0", "laser")
CENTER_MM = np.array([900.0, 150.0, 420.0])
OFF_MM = np.array([1.0, -1.5, 0.5])


def from_flange(state: ChainState) -> FloatArray:
    """The balls from the flange, in L: the levers of the poses' turns."""
    return state.centers_in_laser + state.tool_rotation.T @ state.tool_translation


def observations(kinds: str, seed: int, heights_mm: FloatArray | None = None) -> list[SphereObservation]:
    """Captures of kinds p(rofile), c(loud) and m (measured centre) with noise on points and poses."""
    rng = np.random.default_rng(seed)
    found: list[SphereObservation] = []
    for k, kind in enumerate(kinds):
        turned = rotation_from_vector(rng.uniform(-0.6, 0.6, 3))
        y = rng.uniform(4, 16) * rng.choice([-1, 1]) if heights_mm is None else heights_mm[k]
        seen = np.array([rng.uniform(-20, 20), y, rng.uniform(150, 230)])
        exact = RigidTransform.of(turned, CENTER_MM - turned @ TOOL.apply(seen), "base", "tool0")
        pose = exact.perturbed([*rng.normal(0, SIGMAS.orientation_rad, 3), *rng.normal(0, SIGMAS.position_mm, 3)])
        found.append(observation(f"p{k}", kind, pose, seen, rng))
    return found


def observation(
    name: str, kind: str, pose: RigidTransform, seen: FloatArray, rng: np.random.Generator
) -> SphereObservation:
    if kind == "m":
        measured = seen + rng.normal(0, CENTER_SIGMA_MM, 3)
        covariance = CENTER_SIGMA_MM**2 * np.eye(3)
        return SphereObservation(name, pose, "center", np.empty((0, 3)), measured, covariance)
    if kind == "p":
        radius = np.sqrt(RADIUS_MM**2 - seen[1] ** 2)
        angle = np.linspace(-1.1, 1.1, 60)
        directions = (
            np.column_stack([np.sin(angle) * radius, 0 * angle - seen[1], -np.cos(angle) * radius]) / RADIUS_MM
        )
    else:
        radius = None
        directions = rng.normal(size=(80, 3)) * [1, 1, 0.4] - [0, 0, 1]
        directions /= np.linalg.norm(directions, axis=1)[:, None]
    far = RADIUS_MM + rng.normal(0, POINT_SIGMA_MM, len(directions))
    points = seen + far[:, None] * directions
    if kind == "p":  # noise within the plane of light
        points[:, 1] = 0.0
        center = np.array([seen[0], 0.0, seen[2]])
        return SphereObservation(
            name, pose, "profile", points, center, 1e-3 * np.eye(3), float(radius or 0), POINT_SIGMA_MM
        )
    return SphereObservation(name, pose, "cloud", points, seen, 1e-4 * np.eye(3), None, POINT_SIGMA_MM)


def problem(kinds: str, free_radius: bool, seed: int = 4) -> tuple[ChainData, ChainState, FloatArray, FloatArray]:
    """Data, a state a little off the truth, and the pose errors' spread and its inverse."""
    data = chain_data(observations(kinds, seed), SphereSize(2 * RADIUS_MM, 0.1 if free_radius else 0.0), None)
    near = TOOL.perturbed([1e-4, -2e-4, 1e-4, 0.02, -0.01, 0.03])
    state = ChainState.predicted(data, near.rotation, near.translation_mm, CENTER_MM + 0.02 * OFF_MM)
    spread = pose_spread(from_flange(state), SIGMAS)
    return data, state, spread, np.linalg.inv(spread)


KINDS = pytest.mark.parametrize("kinds", ["ppppppp", "ccccccc", "mmmmmmm", "pcmpcmp"])
FREE = pytest.mark.parametrize("free_radius", [False, True], ids=["known radius", "free radius"])


@KINDS
@FREE
def test_the_gradient_is_that_of_the_cost(kinds: str, free_radius: bool) -> None:
    data, state, spread, precision = problem(kinds, free_radius)
    at = linearise(data, state, spread, precision)
    settled = replace(state, centers_in_laser=at.centers_in_laser)
    steps = np.array([1e-6] * 3 + [1e-3] * 6 + [1e-3] * free_radius)
    for p, size in enumerate(steps):
        step = np.zeros(len(steps))
        step[p] = size
        high = linearise(data, settled.moved(step), spread, precision).cost
        low = linearise(data, settled.moved(-step), spread, precision).cost
        expected = (high - low) / (2 * size)
        # One step's worth of curvature and the settling's own tolerance are the differences' error.
        error = 1e-3 * at.hessian[p, p] * size + 2e-8 / size
        assert at.gradient[p] == pytest.approx(expected, abs=error, rel=1e-3), p


@pytest.mark.parametrize("kinds", ["ppppppp", "pcmpcmp"])
def test_the_gradient_is_that_of_the_cost_in_what_scanners_do_wrong(kinds: str) -> None:
    """Scales, shear, bow and rim: where the two differ, the minimiser walks about for sixty steps and stops."""
    size = SphereSize(2 * RADIUS_MM, 0.1)
    data = chain_data(observations(kinds, 4), size, None, ScannerPriors())
    state = replace(problem(kinds, True)[1], active=data.active)
    state = state.moved(np.array([*[0.0] * 9, 0.02, 0.003, -0.004, 0.006, 5e-4, 0.01, -0.01, 0.01]))
    spread = pose_spread(from_flange(state), SIGMAS)
    precision = np.linalg.inv(spread)
    at = linearise(data, state, spread, precision)
    settled = replace(state, centers_in_laser=at.centers_in_laser)
    for p in range(9, len(at.gradient)):
        step = np.zeros(len(at.gradient))
        step[p] = 0.1 / np.sqrt(at.hessian[p, p])
        high = linearise(data, settled.moved(step), spread, precision).cost
        low = linearise(data, settled.moved(-step), spread, precision).cost
        # In standard deviations; of a cloud's shapes the slope at the found sphere is held.
        assert at.gradient[p] * step[p] == pytest.approx((high - low) / 2, abs=2e-5, rel=1e-3), p
    found = fit(data, state, SIGMAS)
    assert found.converged
    assert found.iterations < 12


@KINDS
@FREE
def test_normal_equations_are_those_with_every_pose_error_written_out(
    kinds: str, free_radius: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Generalised least squares with C = σ² I + G Σ Gᵀ, G by differences from the forward model itself.

    Without the density's other part, which the gradient's test above has.
    """
    monkeypatch.setattr(arrays, "_density_slope", lambda *_: np.zeros(11))
    data, state, spread, precision = problem(kinds, free_radius)
    data = replace(data, effective=np.zeros(data.count))
    at = linearise(data, state, spread, precision)
    hessian, gradient = dense_equations(data, observations(kinds, 4), state, at.centers_in_laser, free_radius)
    scale = np.sqrt(np.diag(hessian))
    np.testing.assert_allclose(at.hessian / np.outer(scale, scale), hessian / np.outer(scale, scale), atol=2e-3)
    np.testing.assert_allclose(at.gradient / scale, gradient / scale, atol=2e-2 * np.abs(gradient / scale).max())
    ours, dense = covariance_of(at.hessian), np.linalg.inv(hessian)
    np.testing.assert_allclose(np.diag(ours), np.diag(dense), rtol=2e-3)


def dense_equations(
    data: ChainData,
    captures: list[SphereObservation],
    state: ChainState,
    own_centers: FloatArray,
    free_radius: bool,
) -> tuple[FloatArray, FloatArray]:
    width = 10 if free_radius else 9
    hessian, gradient = np.zeros((width, width)), np.zeros(width)
    for capture, own in zip(captures, own_centers, strict=True):

        def residuals(x: FloatArray, error: FloatArray, capture=capture, own=own) -> FloatArray:
            """Of the unknowns x (9 or 10) and the pose's error (6), linear about the capture's own centre."""
            tool = RigidTransform.of(state.tool_rotation, state.tool_translation, "tool0", "laser").perturbed(
                x[:6]
            )
            pose = capture.base_from_tool0.perturbed(error)
            q = (pose @ tool).inverse().apply(state.center + x[6:9])
            if capture.kind == "center":
                return q - capture.center_in_laser_mm
            radius = state.radius_mm + (x[9] if free_radius else 0.0)
            about = own if capture.kind == "profile" else capture.center_in_laser_mm
            offsets = capture.points_in_laser_mm - about
            lengths = np.linalg.norm(offsets, axis=1)
            return lengths - radius - (offsets / lengths[:, None]) @ (q - about)

        sigma = CENTER_SIGMA_MM if capture.kind == "center" else POINT_SIGMA_MM
        r = residuals(np.zeros(width), np.zeros(6))
        jacobian = columns(lambda x: residuals(x, np.zeros(6)), [1e-6] * 3 + [1e-3] * (width - 3))
        poses = columns(lambda e: residuals(np.zeros(width), e), [1e-6] * 3 + [1e-3] * 3)
        scatter = np.diag([SIGMAS.orientation_rad**2] * 3 + [SIGMAS.position_mm**2] * 3)
        weight = np.linalg.inv(sigma**2 * np.eye(len(r)) + poses @ scatter @ poses.T)
        hessian += jacobian.T @ weight @ jacobian
        gradient += jacobian.T @ weight @ r
    if free_radius:
        hessian[9, 9] += 1 / data.nuisance_sigmas[0] ** 2
        gradient[9] += (state.radius_mm - data.radius_mm) / data.nuisance_sigmas[0] ** 2
    return hessian, gradient


def columns(function, steps: list[float]) -> FloatArray:
    found = []
    for p, size in enumerate(steps):
        step = np.zeros(len(steps))
        step[p] = size
        found.append((function(step) - function(-step)) / (2 * size))
    return np.array(found).T


@FREE
def test_great_circles_do_no_harm(free_radius: bool) -> None:
    """The plane of light through the sphere's centre says nothing of y: no NaN, no confidence, no bias."""
    heights = np.array([0.0, 1e-9, -1e-4, 0.01, 9.0, -8.0, 12.0, -5.0, 14.0, -12.0])
    captures = observations("p" * 10, 8, heights)
    size = SphereSize(2 * RADIUS_MM, 0.1 if free_radius else 0.0)
    data = chain_data(captures, size, POINT_SIGMA_MM)
    start = ChainState.predicted(data, TOOL.rotation, TOOL.translation_mm, CENTER_MM)
    found = fit(data, start, SIGMAS)
    assert found.converged
    covariance = covariance_of(found.at.hessian)
    assert np.isfinite(covariance).all()
    error = RigidTransform.of(
        found.state.tool_rotation, found.state.tool_translation, "tool0", "laser"
    ).difference(TOOL)
    assert error @ np.linalg.solve(covariance[:6, :6], error) < 27.9  # χ² of 6 at 1e-4
    without = fit(
        data.chosen(np.arange(10) >= 4), replace(start, centers_in_laser=start.centers_in_laser[4:]), SIGMAS
    )
    gained = np.diag(covariance_of(without.at.hessian))[:9] / np.diag(covariance)[:9]
    assert (gained >= 1 - 1e-9).all()  # they tell x and z all the same


def test_a_start_some_way_off_finds_the_same() -> None:
    data = chain_data(observations("p" * 10, 8), SphereSize(2 * RADIUS_MM), POINT_SIGMA_MM)
    near = fit(data, ChainState.predicted(data, TOOL.rotation, TOOL.translation_mm, CENTER_MM), SIGMAS)
    off = TOOL.perturbed([0.01, -0.02, 0.01, 1.5, -1.0, 2.0])
    far = fit(data, ChainState.predicted(data, off.rotation, off.translation_mm, CENTER_MM + OFF_MM), SIGMAS)
    # What the pose errors do is worked out where the start sees the spheres: a shade of the uncertainty.
    sigmas = np.sqrt(np.diag(covariance_of(near.at.hessian)))
    np.testing.assert_allclose(
        far.state.tool_translation, near.state.tool_translation, atol=0.1 * sigmas[3:6].max()
    )
    np.testing.assert_allclose(far.state.center, near.state.center, atol=0.1 * sigmas[6:9].max())


@FREE
def test_the_minimum_is_one(free_radius: bool) -> None:
    """At the end no step of any unknown makes it better, and the captures' own centres lie at theirs."""
    data, state, spread, precision = problem("pcmpcmppc", free_radius)
    found = fit(data, state, SIGMAS)
    sigmas = np.sqrt(np.diag(covariance_of(found.at.hessian)))
    np.testing.assert_allclose(found.at.gradient * sigmas, 0, atol=2e-3)
    again = linearise(data, retract(found.state, np.zeros(len(sigmas)), found.at), spread, precision)
    np.testing.assert_allclose(again.centers_in_laser, found.at.centers_in_laser, atol=1e-4)
    for p in range(len(sigmas)):
        for sign in (-1, 1):
            step = np.zeros(len(sigmas))
            step[p] = sign * 0.5 * sigmas[p]
            spread_there = pose_spread(from_flange(state), SIGMAS)
            moved = linearise(data, found.state.moved(step), spread_there, np.linalg.inv(spread_there))
            assert moved.cost > found.at.cost - 1e-6


@pytest.mark.parametrize("kinds", ["m" * 12, "c" * 12, "cm" * 6])
def test_the_quick_way_for_centers_agrees(kinds: str) -> None:
    data = chain_data(observations(kinds, 5), SphereSize(2 * RADIUS_MM), None)
    near = TOOL.perturbed([0.005, -0.005, 0.01, 0.5, -0.5, 0.5])
    start = ChainState.predicted(data, near.rotation, near.translation_mm, CENTER_MM + 0.5)
    joint, quick = fit(data, start, SIGMAS), fit_centers(data, start, SIGMAS)
    sigmas = np.sqrt(np.diag(covariance_of(joint.at.hessian)))
    np.testing.assert_allclose(
        covariance_of(quick.at.hessian) / np.outer(sigmas, sigmas),
        covariance_of(joint.at.hessian) / np.outer(sigmas, sigmas),
        atol=0.01,
    )
    turn = TOOL.inverse().rotation @ joint.state.tool_rotation, TOOL.inverse().rotation @ quick.state.tool_rotation
    assert np.abs(turn[0] - turn[1]).max() < 0.01 * sigmas[:3].max()
    np.testing.assert_allclose(
        quick.state.tool_translation, joint.state.tool_translation, atol=0.02 * sigmas[3:6].max()
    )
    np.testing.assert_allclose(quick.state.center, joint.state.center, atol=0.02 * sigmas[6:9].max())


def test_pose_errors_spread_the_centre_as_drawn_ones_do() -> None:
    rng = np.random.default_rng(6)
    pose = RigidTransform.of([0.2, 2.9, 0.4], [300.0, 200.0, 700.0], "base", "tool0")
    sigmas = Sigmas(0.05, 1e-3)
    center = (pose @ TOOL).apply([5.0, 8.0, 190.0])
    drawn = np.array([
        (pose.perturbed([*rng.normal(0, sigmas.orientation_rad, 3), *rng.normal(0, sigmas.position_mm, 3)]) @ TOOL)
        .inverse()
        .apply(center)
        for _ in range(3000)
    ])  # fmt: skip
    stated = pose_spread(np.array([[5.0, 8.0, 190.0]]) + TOOL.rotation.T @ TOOL.translation_mm, sigmas)[0]
    root = np.linalg.inv(np.linalg.cholesky(stated))
    # 3000 draws know a covariance to √(2/3000) = 2.6 %; five times that.
    np.testing.assert_allclose(root @ np.cov(drawn.T) @ root.T, np.eye(3), atol=0.13)


def test_captures_of_two_scanners_at_one_stop_share_all_that_errs_there() -> None:
    """Two scanners at the same place, of which nothing but noise of the points can tell one from the other."""
    own = [replace(o, scanner=name) for o in observations("p" * 30, 5) for name in ("left", "right")]
    turned = [
        replace(o, carriers=replace(o.carriers, ball="table"), readings={"table": 0.1 * (k // 2)})
        for k, o in enumerate(own)
    ]
    data = chain_data(turned, SphereSize(2 * RADIUS_MM), POINT_SIGMA_MM, ScannerPriors())
    assert data.stops == 30
    position = Position(
        np.tile(TOOL.rotation, (2, 1, 1)),
        np.tile(TOOL.translation_mm, (2, 1)),
        CENTER_MM[None] - [900.0, 0.0, 0.0],
        (AxisState(np.eye(3), np.array([900.0, 0.0, 0.0])),),
    )
    sigmas = Sigmas(0.05, 2e-4, (1e-3,), 0.04, 1e-4, 0.5)  # a short reach: most of it is each stop's own
    noise = noise_of(data, ChainState.at(data, position), sigmas)
    of_stop = noise.shared.reshape(30, 2, 3, -1)
    assert np.abs(of_stop).max() > 0.05
    np.testing.assert_allclose(of_stop[:, 0], of_stop[:, 1], atol=1e-12)
    assert np.abs(noise.spread).max() < 1e-7
    alone = noise_of(replace(data, stop=np.full(60, -1)), ChainState.at(data, position), sigmas)
    whole, apart = (n.spread + n.shared @ np.swapaxes(n.shared, 1, 2) for n in (noise, alone))
    np.testing.assert_allclose(whole, apart, atol=1e-7)
