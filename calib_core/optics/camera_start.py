"""A first camera and first poses from homographies, in closed form (Z. Zhang, PAMI 2000, with a centred axis)."""

import numpy as np

from calib_core.errors import MotionError
from calib_core.frames import FloatArray
from calib_core.optics.adjust import Corners, State, shared_vector


def homographies(corners: Corners) -> FloatArray:
    """Return the homography (V, 3, 3) from each view's board plane to pixels, by least algebraic error.

    The 9×9 moment matrix of the direct linear transform is summed for all views at once. Pixels that are not
    finite (rays that a distortion does not reach) are left out.
    """
    finite = np.asarray(np.all(np.isfinite(corners.pixels), axis=1))
    board, pixels = corners.points_mm[:, :2], np.where(finite[:, None], corners.pixels, 0.0)
    board_middle, board_size = board.mean(0), max(float(np.ptp(board, axis=0).max()), 1e-9)
    seen = pixels[finite] if finite.any() else pixels
    middle, size = seen.mean(0), max(float(np.ptp(seen, axis=0).max()), 1e-9)
    p = np.column_stack([(board - board_middle) / board_size, np.ones(len(board))])
    u, v = ((pixels - middle) / size).T
    products = (p[:, :, None] * p[:, None, :]).reshape(-1, 9) * finite[:, None]
    starts = corners.ends[:-1]
    plain, by_u, by_v, by_square = (
        np.add.reduceat(products * factor[:, None], starts).reshape(-1, 3, 3)
        for factor in (np.ones_like(u), u, v, u * u + v * v)
    )
    zero = np.zeros_like(plain)
    moments = np.block([[plain, zero, -by_u], [zero, plain, -by_v], [-by_u, -by_v, by_square]])
    solution = np.linalg.eigh(moments)[1][:, :, 0].reshape(-1, 3, 3)
    pixels_from_unit = np.array([[size, 0, middle[0]], [0, size, middle[1]], [0, 0, 1.0]])
    unit_from_board = (
        np.array([[1, 0, -board_middle[0]], [0, 1, -board_middle[1]], [0, 0, board_size]]) / board_size
    )
    return np.asarray(pixels_from_unit @ solution @ unit_from_board)


def homography_misfits_px(corners: Corners, homography: FloatArray) -> FloatArray:
    """Return how far each view's corners lie from its homography, root mean square, (V,), px.

    A lens's distortion alone makes this some pixels; points that are no board make it a good part of the image.
    """
    flat = np.column_stack([corners.points_mm[:, :2], np.ones(len(corners.points_mm))])
    mapped = np.einsum("nij,nj->ni", homography[corners.view_of_each], flat)
    with np.errstate(divide="ignore", invalid="ignore"):
        off = mapped[:, :2] / mapped[:, 2:] - corners.pixels
    squares = np.nan_to_num((off**2).sum(axis=1), nan=np.inf)
    return np.sqrt(np.add.reduceat(squares, corners.ends[:-1]) / np.diff(corners.ends))


def focal_lengths(homography: FloatArray, image_size: tuple[int, int]) -> tuple[float, float]:
    """Return fx and fy, px, that make the boards' axes perpendicular and equally long, the image's centre given.

    Raises
    ------
    MotionError
        If no view is tilted enough to say anything about them.
    """
    centre = _centre(image_size)
    h = homography.copy()
    h[:, 0] -= centre[0] * h[:, 2]
    h[:, 1] -= centre[1] * h[:, 2]
    h /= np.linalg.norm(h[:, :, :2], axis=(1, 2), keepdims=True)
    first, second = h[:, :, 0], h[:, :, 1]
    rows = np.concatenate([first * second, (first**2 - second**2) / 2])
    right = -rows[:, 2]
    inverse_squares = np.linalg.lstsq(rows[:, :2], right, rcond=None)[0]
    if not (inverse_squares > 0).all() or not 0.25 < inverse_squares[0] / inverse_squares[1] < 4:
        together = rows[:, 0] + rows[:, 1]
        inverse_squares = np.full(2, float(together @ right) / max(float(together @ together), 1e-300))
    largest = 50.0 * max(image_size)
    if not inverse_squares[0] > largest**-2:
        need = "views in which the board is tilted, at best by 20 to 45 degrees about different axes"
        to_do = "Take more views with the board tilted."
        raise MotionError(need, "boards that all face the camera squarely, or points that fit no camera", to_do)
    fx, fy = 1.0 / np.sqrt(inverse_squares)
    return float(fx), float(fy)


def centred_camera(homography: FloatArray, image_size: tuple[int, int]) -> FloatArray:
    """Return the camera's matrix (3, 3) by `focal_lengths`, its axis through the image's centre."""
    fx, fy = focal_lengths(homography, image_size)
    cx, cy = _centre(image_size)
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


def poses_from_homographies(homography: FloatArray, camera_matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return camera_from_board of each view: rotations (V, 3, 3) and translations (V, 3), mm."""
    columns = np.linalg.inv(camera_matrix) @ homography
    scale = 2.0 / (np.linalg.norm(columns[:, :, 0], axis=1) + np.linalg.norm(columns[:, :, 1], axis=1))
    columns = columns * (scale * np.where(columns[:, 2, 2] < 0, -1.0, 1.0))[:, None, None]
    third = np.cross(columns[:, :, 0], columns[:, :, 1])
    raw = np.stack([columns[:, :, 0], columns[:, :, 1], third], axis=2)
    u, _, vt = np.linalg.svd(raw)  # the nearest rotations, all at once; raw is right-handed by its third column
    return u @ vt, columns[:, :, 2]


def start_from_homographies(corners: Corners, image_size: tuple[int, int]) -> State:
    """Return a camera without distortion and the poses of all views.

    Raises
    ------
    MotionError
        If the views do not determine a focal length.
    """
    h = homographies(corners)
    matrix = centred_camera(h, image_size)
    return State(shared_vector(matrix, np.zeros((1, 14))), *poses_from_homographies(h, matrix))


def _centre(image_size: tuple[int, int]) -> tuple[float, float]:
    return (image_size[0] - 1) / 2, (image_size[1] - 1) / 2
