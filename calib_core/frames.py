"""Rigid transforms that know the frames they map between.

`into_from_outof` maps points of `outof` into `into`, so that names cancel::

    base_from_ball = base_from_tool0 @ tool0_from_ball

Rotation vectors are in radians, translations in millimetres.  A small change of a pose is a 6-vector
``rx ry rz tx ty tz``: the rotation perturbs on the right, ``R · exp(r)`` with r in the `outof` frame, and the
translation adds, ``t + δt`` in the `into` frame.  Every 6×6 covariance is of such a vector.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from math import atan2, isfinite, sin, sqrt
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.errors import InputError

FloatArray = NDArray[np.float64]

Frame = Literal["pixel", "camera", "laser", "tool0", "base", "turntable", "board"]
FRAMES: tuple[Frame, ...] = get_args(Frame)

_EXACT = 1e-6
_ROUNDED = 2e-3  # a matrix printed with three decimals is still a rotation


def finite_rows(points: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Return which of points (…, K) have K finite coordinates, (…); several times as fast as `all(axis=-1)`."""
    known = np.isfinite(points[..., 0])
    for column in range(1, points.shape[-1]):
        known &= np.isfinite(points[..., column])
    return known


def skew(vectors: ArrayLike) -> FloatArray:
    """Return the matrices whose product with w is the cross product ``v × w``.

    Parameters
    ----------
    vectors : (..., 3)

    Returns
    -------
    (..., 3, 3)
    """
    v = np.asarray(vectors, dtype=float)
    result = np.zeros((*v.shape, 3))
    result[..., 0, 1], result[..., 0, 2] = -v[..., 2], v[..., 1]
    result[..., 1, 0], result[..., 1, 2] = v[..., 2], -v[..., 0]
    result[..., 2, 0], result[..., 2, 1] = -v[..., 1], v[..., 0]
    return result


def cross(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the cross product (3,) of two vectors (3,), as numpy's own does in twenty times the time."""
    (a, b, c), (x, y, z) = one.tolist(), other.tolist()
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])


def rotation_from_vector(vector_rad: ArrayLike) -> FloatArray:
    """Return the 3×3 rotation about the direction of a rotation vector by its length (Rodrigues).

    Parameters
    ----------
    vector_rad : (3,)
    """
    v = np.asarray(vector_rad, dtype=float)
    angle = float(np.linalg.norm(v))
    k = skew(v)
    if angle < 1e-5:  # the series: sin(a)/a and (1 - cos a)/a² lose digits here
        return np.eye(3) + (1 - angle**2 / 6) * k + (0.5 - angle**2 / 24) * (k @ k)
    return np.eye(3) + np.sin(angle) / angle * k + (1 - np.cos(angle)) / angle**2 * (k @ k)


def vector_from_rotation(rotation: ArrayLike) -> FloatArray:
    """Return the rotation vector (…, 3) of rotations (…, 3, 3), its length in [0, π] rad."""
    matrix = np.asarray(rotation, dtype=float)
    if matrix.shape == (3, 3) and (vector := _vector_of_one(matrix)) is not None:
        return vector
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(matrix).as_rotvec(), dtype=np.float64)


def _vector_of_one(matrix: FloatArray) -> FloatArray | None:
    """Return scipy's rotation vector of one matrix, bit for bit, in a thirtieth of the time; None: no rotation."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = matrix.tolist()
    skewed = abs(xx * yx + xy * yy + xz * yz) + abs(xx * zx + xy * zy + xz * zz) + abs(yx * zx + yy * zy + yz * zz)
    longer = abs(xx * xx + xy * xy + xz * xz + yx * yx + yy * yy + yz * yz + zx * zx + zy * zy + zz * zz - 3)
    if not (skewed < 1e-12 and longer < 1e-9):
        return None
    trace = xx + yy + zz
    largest = max(xx, yy, zz, trace)
    if largest == xx:
        x, y, z, w = 1 - trace + 2 * xx, yx + xy, zx + xz, zy - yz
    elif largest == yy:
        x, y, z, w = xy + yx, 1 - trace + 2 * yy, zy + yz, xz - zx
    elif largest == zz:
        x, y, z, w = xz + zx, yz + zy, 1 - trace + 2 * zz, yx - xy
    else:
        x, y, z, w = zy - yz, xz - zx, yx - xy, 1 + trace
    length = sqrt(x * x + y * y + z * z + w * w) * (1 if w >= 0 else -1)
    x, y, z, w = x / length, y / length, z / length, w / length
    angle = 2 * atan2(sqrt(x * x + y * y + z * z), w)
    per_sine = 2 + angle * angle / 12 + 7 * angle**4 / 2880 if angle <= 1e-3 else angle / sin(angle / 2)
    return np.array([per_sine * x, per_sine * y, per_sine * z])


def with_third(axis: FloatArray) -> FloatArray:
    """Return a rotation (3, 3) whose third column is a unit vector (3,)."""
    x = cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    x /= np.linalg.norm(x)
    return np.column_stack([x, cross(axis, x), axis])


def nearest_rotation(matrix: ArrayLike) -> FloatArray:
    """Return the rotations nearest to matrices (…, 3, 3) in the Frobenius norm (orthogonal Procrustes)."""
    u, _, vt = np.linalg.svd(np.asarray(matrix, dtype=float))
    u[..., 2] *= np.linalg.det(u @ vt)[..., None]
    return u @ vt


@dataclass(frozen=True, eq=False)
class RigidTransform:
    """A rotation and a translation that map points of frame `outof` into frame `into`.

    Parameters
    ----------
    matrix : (4, 4)
        Homogeneous, rows, millimetres.  Its rotation must be orthonormal to 1e-6; see `from_rounded` for matrices
        that came from a print-out.
    into, outof : Frame
        The frame of the results and the frame of the arguments.

    Raises
    ------
    InputError
        If the matrix is not a finite rigid transform or a frame is unknown.
    """

    matrix: FloatArray
    into: Frame
    outof: Frame

    def __post_init__(self) -> None:
        matrix = np.array(self.matrix, dtype=float)
        _require_rigid(matrix, _EXACT)
        for frame in (self.into, self.outof):
            if frame not in FRAMES:
                raise InputError.unknown(frame, FRAMES, "frame")
        matrix.flags.writeable = False
        object.__setattr__(self, "matrix", matrix)

    @classmethod
    def identity(cls, into: Frame, outof: Frame) -> "RigidTransform":
        """Return the transform that changes no coordinate."""
        return cls(np.eye(4), into, outof)

    @classmethod
    def of(cls, rotation: ArrayLike, translation_mm: ArrayLike, into: Frame, outof: Frame) -> "RigidTransform":
        """Return the transform with a rotation, (3, 3) or a vector (3,) in rad, and a translation (3,)."""
        r = np.asarray(rotation, dtype=float)
        matrix = np.eye(4)
        matrix[:3, :3] = rotation_from_vector(r) if r.shape == (3,) else r
        matrix[:3, 3] = np.asarray(translation_mm, dtype=float)
        return cls(matrix, into, outof)

    @classmethod
    def from_rounded(cls, matrix: ArrayLike, into: Frame, outof: Frame) -> "RigidTransform":
        """Return the rigid transform nearest to a matrix that was rounded when it was written down.

        Raises
        ------
        InputError
            If it is further from a rotation than rounding to three decimals explains.
        """
        m = np.array(matrix, dtype=float)
        _require_rigid(m, _ROUNDED)
        m[:3, :3] = nearest_rotation(m[:3, :3])
        return cls(m, into, outof)

    @property
    def rotation(self) -> FloatArray:
        """The rotation, (3, 3)."""
        return self.matrix[:3, :3]

    @property
    def translation_mm(self) -> FloatArray:
        """The origin of `outof` in `into`, (3,), mm."""
        return self.matrix[:3, 3]

    @property
    def rotation_vector_rad(self) -> FloatArray:
        """The rotation vector, (3,), rad."""
        return vector_from_rotation(self.rotation)

    def __matmul__(self, other: "RigidTransform") -> "RigidTransform":
        """Compose: ``a_from_b @ b_from_c`` is ``a_from_c``.

        Raises
        ------
        InputError
            If the frames do not meet.
        """
        if self.outof != other.into:
            raise InputError(
                "frames that meet: {into}_from_{outof} @ {outof}_from_…",
                "{name} on the right",
                "Invert one of the two or change their order.",
                into=self.into,
                outof=self.outof,
                name=other.name,
            )
        product = self.matrix @ other.matrix
        # Products of thousands of transforms drift off the rotations; one projection costs little.
        if np.abs(product[:3, :3] @ product[:3, :3].T - np.eye(3)).max() > 1e-12:
            product[:3, :3] = nearest_rotation(product[:3, :3])
        return RigidTransform(product, self.into, other.outof)

    def inverse(self) -> "RigidTransform":
        """Return `outof_from_into`."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation.T
        matrix[:3, 3] = -self.rotation.T @ self.translation_mm
        return RigidTransform(matrix, self.outof, self.into)

    def apply(self, points_mm: ArrayLike) -> FloatArray:
        """Map points (..., 3) of `outof` into `into`, mm."""
        return np.asarray(points_mm, dtype=float) @ self.rotation.T + self.translation_mm

    def rotate(self, directions: ArrayLike) -> FloatArray:
        """Map directions (..., 3) of `outof` into `into`; the translation plays no part."""
        return np.asarray(directions, dtype=float) @ self.rotation.T

    def perturbed(self, xi: ArrayLike) -> "RigidTransform":
        """Return the transform changed by a 6-vector rx ry rz tx ty tz (rad, mm): ``R·exp(r)`` and ``t + δt``."""
        x = np.asarray(xi, dtype=float)
        matrix = np.eye(4)
        matrix[:3, :3] = nearest_rotation(self.rotation @ rotation_from_vector(x[:3]))
        matrix[:3, 3] = self.translation_mm + x[3:]
        return RigidTransform(matrix, self.into, self.outof)

    @property
    def name(self) -> str:
        """Its name, into_from_outof."""
        return f"{self.into}_from_{self.outof}"

    def difference(self, other: "RigidTransform") -> FloatArray:
        """Return the 6-vector `xi` with ``other = self.perturbed(xi)``, rad and mm."""
        if (self.into, self.outof) != (other.into, other.outof):
            raise InputError(
                "two transforms {name}",
                other.name,
                "Compare transforms between the same frames.",
                name=self.name,
            )
        rotation = vector_from_rotation(self.rotation.T @ other.rotation)
        return np.concatenate([rotation, other.translation_mm - self.translation_mm])

    def to_rows(self) -> list[list[float]]:
        """Return the matrix as nested lists, for JSON."""
        return self.matrix.tolist()


def stack_matrices(transforms: Sequence[RigidTransform]) -> FloatArray:
    """Return the matrices of transforms as one array (N, 4, 4)."""
    return np.array([t.matrix for t in transforms]).reshape(-1, 4, 4)


def _require_rigid(matrix: FloatArray, tolerance: float) -> None:
    if matrix.shape != (4, 4):
        to_do = "Give 16 numbers, row by row."
        raise InputError("a 4×4 matrix", "an array of shape {shape}", to_do, shape=matrix.shape)
    rows = matrix.tolist()  # plain numbers: many times faster than arrays of nine
    if not all(map(isfinite, chain.from_iterable(rows))):
        raise InputError("a finite matrix", "NaN or infinity", "Check where the poses come from.")
    (xx, xy, xz, _), (yx, yy, yz, _), (zx, zy, zz, _), last = rows
    error = max(
        abs(xx * xx + xy * xy + xz * xz - 1),
        abs(yx * yx + yy * yy + yz * yz - 1),
        abs(zx * zx + zy * zy + zz * zz - 1),
        abs(xx * yx + xy * yy + xz * yz),
        abs(xx * zx + xy * zy + xz * zz),
        abs(yx * zx + yy * zy + yz * zz),
    )
    if error > tolerance:
        need = "a rotation in the upper left 3×3 (orthonormal rows)"
        to_do = "Check that the numbers are given row by row and that nothing was scaled."
        raise InputError(need, "rows that are off by {error:.2g}", to_do, error=error)
    if xx * (yy * zz - yz * zy) + xy * (yz * zx - yx * zz) + xz * (yx * zy - yy * zx) < 0:
        to_do = "Check the signs of the axes."
        raise InputError("a right-handed rotation", "a mirrored one (determinant −1)", to_do)
    if max(abs(last[0]), abs(last[1]), abs(last[2]), abs(last[3] - 1)) > tolerance:
        to_do = "Give the matrix row by row; if it is given by columns, transpose it."
        raise InputError("a last row of 0 0 0 1", " ".join(f"{v:g}" for v in last), to_do)
