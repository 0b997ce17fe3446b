"""Board hand-eye: the closed form against cv2.calibrateHandEye (Park), time over 100 views and exactness."""

import cv2
import numpy as np
from harness import Row, interleaved_medians_s

from calib_core.frames import FloatArray, RigidTransform, stack_matrices
from calib_core.optics.hand_eye import solve_hand_eye
from calib_core.optics.hand_eye_closed import solve_ax_zb

_CAMERA = RigidTransform.of([0.3, -0.2, 1.1], [40.0, -75.0, 60.0], "tool0", "camera")
_BOARD = RigidTransform.of([0.1, 3.0, 0.2], [850.0, -120.0, 35.0], "base", "board")


def run(full: bool) -> list[Row]:
    """Return the figures over 200 simulated cells in full, 30 otherwise."""
    return [speed(9 if full else 3), *exactness(range(200 if full else 30))]


def speed(rounds: int) -> Row:
    """Return the closed form's time over 100 views against that of Park's."""
    robots, boards = views(0, 100)
    a, b = stack_matrices(robots), np.linalg.inv(stack_matrices(boards))
    seconds = interleaved_medians_s(
        {"ours": lambda: solve_ax_zb(a, b), "Park": lambda: park(robots, boards)}, rounds
    )
    ratio = seconds["Park"] / seconds["ours"]
    return Row("closed form, 100 views: Park's time over ours", "≥ 50", f"{ratio:.0f}", ratio >= 50)


def exactness(seeds: range) -> list[Row]:
    """Return the errors of both and of the refined answer, and whether that errs as it states.

    The refined one is told that the pitch is right, as the closed forms take it.
    """
    errors: dict[str, list[FloatArray]] = {"ours": [], "Park": [], "refined": []}
    squares: list[float] = []
    for seed in seeds:
        robots, boards = views(seed, 25)
        closed, _ = solve_ax_zb(stack_matrices(robots), np.linalg.inv(stack_matrices(boards)))
        refined = solve_hand_eye(robots, boards, 0.05, 2e-4, pitch_sigma=1e-5)
        errors["ours"].append(RigidTransform(closed, "tool0", "camera").difference(_CAMERA))
        errors["Park"].append(park(robots, boards).difference(_CAMERA))
        errors["refined"].append(off := refined.mount_from_camera.difference(_CAMERA))
        squares.append(float(off @ np.linalg.solve(refined.covariance[:6, :6], off)))
    rms = {n: [_rms(np.array(e)[:, :3]) * 1e3, _rms(np.array(e)[:, 3:])] for n, e in errors.items()}
    nees = float(np.mean(squares))
    told = "; ".join(f"{name} {turn:.3f} mrad, {shift:.3f} mm" for name, (turn, shift) in rms.items())
    exact = all(rms["ours"][k] <= 1.02 * rms["Park"][k] for k in (0, 1))
    return [
        Row(f"{len(seeds)} cells of 25 views: errors, RMS", "ours ≤ Park's", told, exact),
        Row("the refined answer: mean NEES (6)", "4.5–7.5", f"{nees:.2f}", 4.5 <= nees <= 7.5),
    ]


def views(seed: int, count: int) -> tuple[list[RigidTransform], list[RigidTransform]]:
    """Return robot poses as reported, and the boards as the camera has them at poses that err."""
    rng = np.random.default_rng([seed, 71])
    robots: list[RigidTransform] = []
    boards: list[RigidTransform] = []
    for _ in range(count):
        board = RigidTransform.of(rng.uniform(-0.4, 0.4, 3), [*rng.uniform(-20, 20, 2), 250], "camera", "board")
        robot = _BOARD @ (_CAMERA @ board).inverse()
        error = np.concatenate([rng.normal(0, 2e-4, 3), rng.normal(0, 0.05, 3)])
        robots.append(robot)
        boards.append((robot.perturbed(error) @ _CAMERA).inverse() @ _BOARD)
    return robots, boards


def park(robots: list[RigidTransform], boards: list[RigidTransform]) -> RigidTransform:
    rotation, translation = cv2.calibrateHandEye(
        [r.rotation for r in robots],
        [r.translation_mm for r in robots],
        [b.rotation for b in boards],
        [b.translation_mm for b in boards],
        method=cv2.CALIB_HAND_EYE_PARK,
    )
    return RigidTransform.of(rotation, translation.ravel(), "tool0", "camera")


def _rms(rows: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.sum(rows**2, axis=1))))
