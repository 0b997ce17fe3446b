"""The camera from views: truth recovered, spoiled views rejected by name, and the model that the data asks for."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from calib_core.errors import InputError, MotionError
from calib_core.frames import FloatArray, vector_from_rotation
from calib_core.optics.board import BoardView
from calib_core.optics.camera import CameraOptions, calibrate_camera
from calib_core.optics.camera_evidence import camera_findings
from calib_core.optics.camera_layout import parameter_places
from calib_core.optics.camera_model import CameraModel, Model, Segment
from calib_core.records import parse_session
from calib_core.records.camera_result import CameraResult
from calib_core.stages.pipeline import solve_stage

SIZE = (1280, 1024)
MATRIX = np.array([[2400.0, 0, 650], [0, 2390, 500], [0, 0, 1]])
PLAIN = CameraModel.from_names(MATRIX, {"k1": -0.2, "k2": 0.12, "p1": 0.001, "p2": -0.0007}, SIZE)
TILTED = CameraModel.from_names(MATRIX, {"k1": -0.2, "k2": 0.12, "tauX": 0.10, "tauY": -0.04}, SIZE)
SQUARE = replace(PLAIN, camera_matrix=MATRIX * [[1, 1, 1], [0, MATRIX[0, 0] / MATRIX[1, 1], 1], [0, 0, 1]])
BOARD = np.array([[x, y, 0.0] for y in range(8) for x in range(11)]) * 8


def view(pixels: FloatArray) -> BoardView:
    return BoardView(pixels, BOARD, np.arange(len(BOARD)), SIZE, 0.05)


def simulate(
    camera: CameraModel, count: int, seed: int, sigma_px: float = 0.05, depths: tuple[float, float] = (300, 600)
) -> list[BoardView]:
    rng = np.random.default_rng(seed)
    views: list[BoardView] = []
    while len(views) < count:
        r = Rotation.from_rotvec(rng.uniform(-0.6, 0.6, 3)).as_matrix()
        z = rng.uniform(*depths)
        t = np.array([rng.uniform(-0.15, 0.15) * z, rng.uniform(-0.12, 0.12) * z, z]) - r @ BOARD.mean(0)
        pixels = camera.project(BOARD @ r.T + t)
        if (pixels > 0).all() and (pixels < SIZE).all():
            views.append(view(pixels + rng.normal(0, sigma_px, pixels.shape)))
    return views


def held_out_rms_px(camera: CameraModel, views: list[BoardView]) -> float:
    """Of views that had no part: their poses alone are fitted, by an independent general solver."""
    from scipy.optimize import least_squares

    from calib_core.optics.adjust import Corners
    from calib_core.optics.camera_start import homographies, poses_from_homographies

    squares = []
    for v in views:
        middle = 450.0 if camera.segments else None
        rays = camera.undistort(v.points_px, middle)
        corners = Corners.of([rays], [BOARD])
        r, t = poses_from_homographies(homographies(corners), np.eye(3))

        def residuals(x: FloatArray, v: BoardView = v) -> FloatArray:
            points = BOARD @ Rotation.from_rotvec(x[:3]).as_matrix().T + x[3:]
            return (camera.project(points) - v.points_px).ravel()

        start = np.concatenate([Rotation.from_matrix(r[0]).as_rotvec(), t[0]])
        end = least_squares(residuals, start, x_scale=[1e-3, 1e-3, 1e-3, 1, 1, 1])
        squares.append((end.fun**2).reshape(-1, 2).sum(1))
    return float(np.sqrt(np.mean(squares)))


@pytest.mark.thorough
def test_plain_camera_is_found_within_its_covariance() -> None:
    truth = np.array([2400, 2390, 650, 500, -0.2, 0.12, 0.001, -0.0007, 0.0])
    scores = []
    runs = 20
    for seed in range(runs):
        solution = calibrate_camera(simulate(PLAIN, 12, seed), SIZE, CameraOptions(model="plain"))
        found = np.concatenate(
            [solution.camera.camera_matrix[[0, 1, 0, 1], [0, 1, 2, 2]], solution.camera.distortion[:5]]
        )
        error = found - truth
        scores.append(error @ np.linalg.solve(solution.covariance, error))
        assert solution.corner_sigma_px == pytest.approx(0.05, rel=0.1)
    low, high = chi2.ppf([0.005, 0.995], 9 * runs) / runs
    assert low < np.mean(scores) < high


@pytest.mark.parametrize("sigma_px", [0.02, 0.08])
def test_the_covariance_is_that_of_all_corners_together_by_an_independent_jacobian(sigma_px: float) -> None:
    from scipy.optimize import least_squares

    views = simulate(PLAIN, 12, 3, sigma_px)
    solution = calibrate_camera(views, SIZE, CameraOptions(model="plain"))
    poses = [pose for pose in solution.camera_from_board if pose is not None]
    assert len(poses) == 12
    found = solution.camera.camera_matrix[[0, 1, 0, 1], [0, 1, 2, 2]]
    at = [found, solution.camera.distortion[:5]]
    at += [np.concatenate([vector_from_rotation(pose.rotation), pose.translation_mm]) for pose in poses]

    def residuals(x: FloatArray) -> FloatArray:
        matrix = np.array([[x[0], 0, x[2]], [0, x[1], x[3]], [0, 0, 1]])
        names = dict(zip(("k1", "k2", "p1", "p2", "k3"), x[4:9].tolist(), strict=True))
        camera = CameraModel.from_names(matrix, names, SIZE)
        places = x[9:].reshape(-1, 6)
        shown = [camera.project(BOARD @ Rotation.from_rotvec(v[:3]).as_matrix().T + v[3:]) for v in places]
        return np.concatenate([(a - b.points_px).ravel() for a, b in zip(shown, views, strict=True)])

    here = least_squares(residuals, np.concatenate(at), x_scale="jac", max_nfev=1)
    assert np.sqrt(np.mean(here.fun**2)) == pytest.approx(sigma_px, rel=0.1)
    expected = sigma_px**2 * np.linalg.inv(here.jac.T @ here.jac)[:9, :9]
    np.testing.assert_allclose(np.sqrt(np.diag(solution.covariance)[:9]), np.sqrt(np.diag(expected)), rtol=0.15)


def test_the_plain_model_stays_where_it_is_true() -> None:
    solution = calibrate_camera(simulate(PLAIN, 20, 1), SIZE)
    assert solution.camera.model == "plain"
    assert {c.model for c in solution.candidates} == {"plain", "rational", "tilted", "segmental"}
    assert [one.values["than"] for one in camera_findings(solution) if one.code == "camera-model-chosen"] == [
        "plain"
    ]


@pytest.mark.thorough
def test_a_tilted_sensor_over_300_mm_is_found_and_pays() -> None:
    views, fresh = simulate(TILTED, 30, 2, 0.02), simulate(TILTED, 8, 50, 0.0)
    solution = calibrate_camera(views, SIZE)
    assert solution.camera.model == "tilted"
    deviation = np.sqrt(np.diag(solution.covariance))[-2:]
    assert (np.abs(solution.camera.distortion[12:] - [0.10, -0.04]) < 4 * deviation).all()
    assert deviation.max() < 0.001
    assert solution.tilt_correlation is not None
    assert solution.tilt_correlation > 0.7
    plain = calibrate_camera(views, SIZE, CameraOptions(model="plain"))
    assert held_out_rms_px(plain.camera, fresh) > 10 * held_out_rms_px(solution.camera, fresh)


@pytest.mark.thorough
def test_a_decentred_lens_does_not_spoil_a_tilted_camera() -> None:
    names = {**TILTED.distortion_by_name, "p1": 0.001, "p2": -0.0007}
    truth = CameraModel.from_names(MATRIX, names, SIZE)
    solution = calibrate_camera(simulate(truth, 30, 2, 0.02), SIZE)
    assert solution.camera.model == "tilted"
    assert held_out_rms_px(solution.camera, simulate(truth, 8, 50, 0.0)) < 0.004


@pytest.mark.thorough
def test_a_lens_that_changes_with_depth_asks_for_bands() -> None:
    near, far = PLAIN.distortion.copy(), PLAIN.distortion.copy()
    far[:2] = [-0.26, 0.2]
    truth = CameraModel(MATRIX, near, "segmental", SIZE, (Segment(250, 560, near), Segment(340, 700, far)))
    views, fresh = simulate(truth, 40, 3, 0.02), simulate(truth, 8, 60, 0.0)
    solution = calibrate_camera(views, SIZE)
    assert solution.camera.model == "segmental"
    plain = calibrate_camera(views, SIZE, CameraOptions(model="plain"))
    assert held_out_rms_px(plain.camera, fresh) > 3 * held_out_rms_px(solution.camera, fresh)


def test_no_step_where_bands_meet() -> None:
    views = simulate(TILTED, 40, 4, 0.02)
    camera = calibrate_camera(views, SIZE, CameraOptions(model="segmental")).camera
    camera = camera.with_laser_plane([0.0, 0.8, 0.6], 260.0)
    rays = camera.undistort(np.column_stack([np.full(40000, 900.0), np.linspace(150, 900, 40000)]))
    depth = 260.0 / (0.8 * rays[:, 1] + 0.6)
    assert depth.min() < camera.segments[0].far_mm
    assert depth.max() > camera.segments[-1].near_mm
    # the surface advances by about 20 µm a step here; a jump where bands meet would stand out by itself
    steps = np.diff(depth) * 1e3
    assert np.abs(np.diff(steps)).max() < 2.0


def test_spoiled_views_are_named() -> None:
    views = simulate(PLAIN, 15, 5)
    rng = np.random.default_rng(5)
    views[4] = view(views[4].points_px + rng.normal(0, 3.0, views[4].points_px.shape))
    bent = views[9].points_px.copy()
    bent[::7] += 4.0
    views[9] = view(bent)
    solution = calibrate_camera(views, SIZE, CameraOptions(model="plain"))
    assert list(solution.rejected) == [4]
    assert solution.rejected[4]["off"] == "camera"
    assert solution.camera_from_board[4] is None
    assert solution.rejected_corners >= len(bent[::7])
    assert solution.camera.camera_matrix[0, 0] == pytest.approx(2400, abs=4 * np.sqrt(solution.covariance[0, 0]))


@pytest.mark.thorough
def test_errors_that_a_view_shares_widen_the_covariance() -> None:
    # A smooth error per view, as a localisation's bias or a bent air makes it, beside independent noise.
    scores, inflations = [], []
    for seed in range(12):
        rng = np.random.default_rng(300 + seed)
        views = []
        for v in simulate(PLAIN, 14, 300 + seed):
            unit = (v.points_px - v.points_px.mean(0)) / np.ptp(v.points_px, axis=0)
            basis = np.column_stack([unit, unit[:, :1] * unit[:, 1:], unit**2])
            views.append(view(v.points_px + basis @ rng.normal(0, 0.15, (basis.shape[1], 2))))
        solution = calibrate_camera(views, SIZE, CameraOptions(model="plain"))
        error = solution.camera.camera_matrix[[0, 1, 0, 1], [0, 1, 2, 2]] - [2400, 2390, 650, 500]
        scores.append(error @ np.linalg.solve(solution.covariance[:4, :4], error) / 4)
        inflations.append(solution.inflation)
    assert np.mean(inflations) > 1.5
    assert np.mean(scores) < 2.5  # 1.7 as measured; 9.7 without
    assert calibrate_camera(simulate(PLAIN, 14, 1), SIZE, CameraOptions(model="plain")).inflation < 1.4


def test_points_that_are_no_board_are_named_and_harmless() -> None:
    rng = np.random.default_rng(13)
    garbage = [view(rng.uniform(0, 1000, BOARD[:, :2].shape)) for _ in range(4)]
    solution = calibrate_camera([*simulate(PLAIN, 9, 13), *garbage], SIZE)
    assert sorted(solution.rejected) == [9, 10, 11, 12]
    assert solution.rejected[9]["off"] == "board"
    assert solution.camera.camera_matrix[0, 0] == pytest.approx(2400, abs=4 * np.sqrt(solution.covariance[0, 0]))
    with pytest.raises(MotionError, match="at least 3 views"):
        calibrate_camera(garbage, SIZE)


def test_few_views_get_no_fancy_model() -> None:
    solution = calibrate_camera(simulate(PLAIN, 4, 14), SIZE)
    assert solution.camera.model == "plain"
    assert solution.candidates == ()


def test_poor_views_are_talked_about() -> None:
    views = simulate(PLAIN, 4, 6, depths=(550, 600))
    found = camera_findings(calibrate_camera(views, SIZE, CameraOptions(model="plain")))
    assert [one.values for one in found if one.code == "few-views"] == [{"count": 4}]


def bent_views(seed: int, bend_mm: float, x_pitch: float = 1.0, roll: float = 0.5) -> list[BoardView]:
    """15 views of a board that is bent or printed wide."""
    rng = np.random.default_rng(seed)
    height = bend_mm * ((BOARD[:, 0] - 40) / 40) ** 2  # from middle to edge
    printed = BOARD * [x_pitch, 1, 1] + np.column_stack([np.zeros((len(BOARD), 2)), height])
    views: list[BoardView] = []
    for _ in range(15):
        r = Rotation.from_rotvec([*rng.uniform(-0.5, 0.5, 2), rng.uniform(-roll, roll)]).as_matrix()
        t = rng.uniform([-30, -25, 330], [30, 25, 450]) - r @ BOARD.mean(0)
        pixels = SQUARE.project(printed @ r.T + t)
        views.append(view(pixels + rng.normal(0, 0.05, pixels.shape)))
    return views


@pytest.mark.thorough
def test_a_bent_board_is_told_and_its_shape_solved_where_held_out_views_ask_for_it() -> None:
    views = bent_views(12, 0.4)
    flat = calibrate_camera(views, SIZE, CameraOptions(model="plain"))
    assert any("bent by 0." in one.text for one in camera_findings(flat))
    solved = calibrate_camera(views, SIZE, CameraOptions(refine_board=None))
    assert solved.bend_mm == pytest.approx(0.4, abs=0.05)
    assert solved.corner_sigma_px == pytest.approx(0.05, rel=0.05)
    assert {one.code for one in camera_findings(solved)} >= {"board-shape-solved"}
    assert [name for name in solved.parameters if name.startswith("board")] == ["board1", "board2", "board3"]
    assert not any(one.code == "board-bent" for one in camera_findings(solved))
    sigma = float(np.sqrt(solved.covariance[0, 0]))
    assert abs(solved.camera.camera_matrix[0, 0] - SQUARE.camera_matrix[0, 0]) < 3 * sigma
    right = calibrate_camera(bent_views(12, 0.0), SIZE, CameraOptions(refine_board=None))
    assert right.board_shape is not None
    assert right.board_shape.bend_mm(BOARD) < 0.02
    assert right.bend_mm is None
    assert not any("bent" in one.code or "shape" in one.code for one in camera_findings(right))


@pytest.mark.thorough
def test_a_bend_too_slight_to_be_told_draws_the_focal_length_no_further_than_is_stated() -> None:
    off: list[float] = []
    for seed in range(12):
        views = bent_views(seed, 0.02)[:7]
        solved = calibrate_camera(views, SIZE, CameraOptions(model="plain", refine_board=None))
        error = solved.camera.camera_matrix[0, 0] - SQUARE.camera_matrix[0, 0]
        off.append(error / float(np.sqrt(solved.covariance[0, 0])))
    assert np.sqrt(np.mean(np.square(off))) < 1.25


def test_a_view_of_an_unknown_part_of_the_board_stays_where_nothing_says_that_the_board_is_bent() -> None:
    views = bent_views(12, 0.0)
    views[3] = replace(views[3], is_numbered=False)
    solved = calibrate_camera(views, SIZE, CameraOptions(model="plain", refine_board=None))
    assert solved.rejected == {}
    assert solved.board_shape is None


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("roll", [0.05, 1.6])
def test_a_board_printed_wide_is_named_and_the_camera_within_what_is_stated(roll: float) -> None:
    solved = calibrate_camera(bent_views(5, 0.0, 1.01, roll), SIZE, CameraOptions(refine_board=None))
    (named,) = [one for one in camera_findings(solved) if one.code == "board-pitches-differ"]
    assert named.values["ratio"] == pytest.approx(1 / 1.01, abs=0.002)
    change = np.diag(solved.camera.camera_matrix)[:2] - np.diag(SQUARE.camera_matrix)[:2]
    assert (np.abs(change) < 3 * np.sqrt(np.diag(solved.covariance)[:2])).all()
    right = calibrate_camera(bent_views(5, 0.0, 1.0, roll), SIZE, CameraOptions(refine_board=None))
    assert right.pitch is None
    # Upright boards tell it by fx / fy alone, as well as pixels are square; turned ones by their corners too.
    slopes = np.array([1, -1]) / np.diag(SQUARE.camera_matrix)[:2]
    by_focals = float(np.hypot(np.sqrt(slopes @ right.covariance[:2, :2] @ slopes), 5e-4))
    assert solved.pitch is not None
    assert solved.pitch.sigma == pytest.approx(by_focals, rel=0.3) if roll < 1 else solved.pitch.sigma < by_focals


@pytest.mark.parametrize("count", [0, 2])
def test_too_few_views(count: int) -> None:
    with pytest.raises(MotionError, match="at least 3 views"):
        calibrate_camera(simulate(PLAIN, count, 7), SIZE)


def test_a_segmental_camera_needs_depth() -> None:
    with pytest.raises(MotionError, match="near to far"):
        calibrate_camera(simulate(PLAIN, 8, 8, depths=(400, 405)), SIZE, CameraOptions(model="segmental"))


@pytest.mark.parametrize(("model", "count"), [("plain", 9), ("tilted", 9), ("segmental", 0)])
def test_parameters_know_their_places(model: Model, count: int) -> None:
    solution = calibrate_camera(simulate(PLAIN, 30, 9), SIZE, CameraOptions(model=model, refine_board=True))
    places = parameter_places(solution.parameters)
    bands = len(solution.camera.segments)
    assert len(places) == (count or 4 + 5 * bands)
    assert len(solution.parameters) == len(places) + 7
    assert solution.covariance.shape == (len(places) + 7,) * 2
    assert solution.board_shape is not None
    assert np.abs(solution.board_shape.coefficients_mm).max() < 0.1


def frames(count: int, size: tuple[int, int] = (640, 480)) -> dict[str, bytes]:
    """A board of squares drawn by its corners' homography, one PNG each."""
    import cv2

    rng = np.random.default_rng(11)
    pattern = np.full((80 * 10, 110 * 10), 255, np.uint8)
    for row in range(7):
        for column in range(10):
            if (row + column) % 2 == 0:
                pattern[50 + row * 100 : 150 + row * 100, 50 + column * 100 : 150 + column * 100] = 20
    files: dict[str, bytes] = {}
    matrix = np.array([[900.0, 0, 320], [0, 900, 240], [0, 0, 1]])
    for k in range(count):
        r = Rotation.from_rotvec(rng.uniform(-0.5, 0.5, 3)).as_matrix()
        middle = np.array([55.0, 40.0, 0])
        t = np.array([rng.uniform(-15, 15), rng.uniform(-10, 10), rng.uniform(190, 230)]) - r @ middle
        shrink = np.diag([0.1, 0.1, 1.0]) @ np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
        h = matrix @ np.column_stack([r[:, 0], r[:, 1], t]) @ shrink
        picture = cv2.warpPerspective(pattern, h, size, flags=cv2.INTER_AREA, borderValue=128)
        picture = cv2.GaussianBlur(picture, (0, 0), 0.8)
        files[f"captures/f{k}.png"] = cv2.imencode(".png", picture)[1].tobytes()
    return files


def session_of(files: dict[str, bytes], **cell: object):
    board = {"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 10.0}
    return parse_session({
        "format": "scancell-session/1",
        "cell": {"pose_convention": "matrix", "board": board, **cell},
        "captures": [
            {"id": f"f{k}", "step": "camera", "kind": "frame", "files": [name]} for k, name in enumerate(files)
        ],
    })  # fmt: skip


def test_the_stage_from_frames_to_result() -> None:
    files = frames(9)
    black = np.zeros((480, 640), np.uint8)
    import cv2

    files["captures/black.png"] = cv2.imencode(".png", black)[1].tobytes()
    result = solve_stage(session_of(files), "camera", files.__getitem__)
    assert isinstance(result, CameraResult)
    assert result.reprojection_rms_px < 0.3
    assert result.camera_matrix[0][0] == pytest.approx(900, rel=0.01)
    assert [row.used for row in result.residuals] == [True] * 9 + [False]
    assert "black frame" in (result.residuals[-1].reason or "")
    assert any("f9 is not used" in note for note in result.notes)
    assert len(result.covariance) == len(result.parameters)
    assert CameraResult.model_validate_json(result.model_dump_json()) == result


def test_bad_sessions_are_refused_in_words() -> None:
    import cv2

    files = frames(3)
    with pytest.raises(InputError, match=r"cell\.board"):
        solve_stage(session_of(files, board=None), "camera", files.__getitem__)
    larger = {**files, **{k.replace("f0", "g0"): v for k, v in frames(1, (700, 500)).items()}}
    with pytest.raises(InputError, match="mixed image sizes"):
        solve_stage(session_of(larger), "camera", larger.__getitem__)
    blank = {"captures/a.png": cv2.imencode(".png", np.full((480, 640), 90, np.uint8))[1].tobytes()}
    with pytest.raises(Exception, match="none of 1 frames shows the board"):
        solve_stage(session_of(blank), "camera", blank.__getitem__)
    known = {"camera": {"camera_matrix": MATRIX.tolist(), "distortion": {}}}
    with pytest.raises(InputError, match=r"cell\.known"):
        solve_stage(session_of(files, known=known), "camera", files.__getitem__)
