"""Which parameters of a camera model are free, and where they lie in the vector that is adjusted."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib_core.frames import FloatArray
from calib_core.kernels.bundle import PLANE_TERMS, SHAPE_TERMS
from calib_core.optics.adjust import Adjustment, Corners, State, plane_start, shape_start, shared_vector
from calib_core.optics.camera_model import COEFFICIENTS, CameraModel, Model, Segment

_LEAST_DEPTH_RATIO = 1.25  # farthest over nearest corner: below, one set of coefficients holds for all
_LEAST_CORNERS = 200
_LEAST_VIEWS = 4

_SLIGHT_BEND = 0.003  # of half a board's length; sheets that are bent further are told by held-out views


@dataclass(frozen=True, eq=False)
class Layout:
    """Which shared parameters a model frees, its bands of depth, and what is known before any view.

    `prior` is that of `Adjustment`.
    """

    model: Model
    nears: FloatArray
    fars: FloatArray
    free: np.ndarray
    prior: FloatArray | None = None

    def adjustment(self, corners: Corners, huber: float = np.inf) -> Adjustment:
        """Return what is adjusted to corners, weighed by their noise."""
        return Adjustment(corners, *self.bands, self.free, huber, prior=self.prior)

    @property
    def bands(self) -> tuple[FloatArray, FloatArray]:
        """The bands' near and far ends, (B,), mm."""
        return self.nears, self.fars

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters."""
        return tuple(parameter_name(int(i), len(self.nears)) for i in self.free)

    @property
    def shape_terms(self) -> int:
        """How many terms of the board's shape are free."""
        return int(np.sum(self.free >= shape_start(len(self.nears))))

    @property
    def bends(self) -> bool:
        """Whether the board's shape is free."""
        return self.shape_terms > 0

    def with_bent_board(self, terms: int = SHAPE_TERMS) -> "Layout":
        """Return the layout with the board's shape free too: its first 3 terms are quadratic, all 7 cubic."""
        start = shape_start(len(self.nears))
        lens = self.free[self.free < start]
        return replace(self, free=np.concatenate([lens, np.arange(start, start + terms)]))

    def with_slight_bend(self, extent_mm: FloatArray, terms: int) -> "Layout":
        """Return the layout with the first terms of the board's shape free, as far as sheets that seem flat bend.

        A bend that views are too few to tell draws the focal length by more than flat boards have it state.
        """
        start = shape_start(len(self.nears))
        sigma_mm = _SLIGHT_BEND * max(float((extent_mm[1] - extent_mm[0]).max()) / 2, 1e-9)
        prior = np.zeros(plane_start(len(self.nears)) + PLANE_TERMS)
        prior[start : start + SHAPE_TERMS] = sigma_mm**-2
        return replace(self.with_bent_board(terms), prior=prior)


def restart(state: State, layout: Layout) -> State:
    """Return a state laid out for another model: the same camera, its distortion in every band, a flat board.

    A layout that frees nothing of the lens is of a camera that is known.
    """
    start = shape_start(len(layout.nears))
    if not np.any(layout.free < start):
        shared = state.shared.copy()
        shared[start : start + SHAPE_TERMS] = 0.0
        return State(shared, state.rotations, state.translations)
    matrix = np.array([[state.shared[0], 0, state.shared[2]], [0, state.shared[1], state.shared[3]], [0, 0, 1.0]])
    lens = np.zeros(14)
    own = [int(place) - 4 for place in layout.free if 4 <= place < 18]
    lens[own] = state.shared[4:18][own]
    bands = np.tile(lens, (len(layout.nears), 1))
    return State(shared_vector(matrix, bands), state.rotations, state.translations)


def camera_of(shared: FloatArray, layout: Layout, image_size: tuple[int, int]) -> CameraModel:
    """Return the camera that a shared vector describes."""
    matrix = np.array([[shared[0], 0, shared[2]], [0, shared[1], shared[3]], [0, 0, 1.0]])
    count = len(layout.nears)
    bands = shared[4 : 4 + 14 * count].reshape(count, 14).copy()
    if layout.model != "segmental":
        return CameraModel(matrix, bands[0], layout.model, image_size)
    segments = tuple(
        Segment(float(a), float(b), d) for a, b, d in zip(layout.nears, layout.fars, bands, strict=True)
    )
    return CameraModel(matrix, bands[count // 2], "segmental", image_size, segments)


def parameter_places(names: Sequence[str], with_board: bool = False) -> np.ndarray:
    """Return the places (C,) in the shared vector of named parameters; those of the board only where asked for."""
    band_count = max([int(name.partition("@")[2] or 1) for name in names], default=1)
    places = {parameter_name(i, band_count): i for i in range(shape_start(band_count) + SHAPE_TERMS)}
    return np.array([places[n] for n in names if with_board or not n.startswith("board")], dtype=np.int64)


def parameter_name(place: int, bands: int) -> str:
    """Return the name of a place in the shared vector; coefficients of bands end in their number, from near."""
    if place < 4:
        return ("fx", "fy", "cx", "cy")[place]
    if place < shape_start(bands):
        band, j = divmod(place - 4, 14)
        return COEFFICIENTS[j] if bands == 1 else f"{COEFFICIENTS[j]}@{band + 1}"
    return f"board{place - shape_start(bands) + 1}"


def corner_depths(corners: Corners, state: State) -> FloatArray:
    """Return the depth z of every corner in the camera frame, (N,), mm."""
    views = corners.view_of_each
    return np.einsum("nj,nj->n", state.rotations[views, 2], corners.points_mm) + state.translations[views, 2]


def depth_bands(corners: Corners, state: State, most: int) -> tuple[FloatArray, FloatArray] | None:
    """Return the bands' near and far ends (B,), mm, or None where the views do not span enough depth.

    Each band reaches from the middle of the one before it to the middle of the one after, so that the coefficients
    run linearly from middle to middle and nowhere make a step. The middles are equally
    far apart in inverse depth, the quantity in which an image changes evenly. Each band must hold 200 corners of
    four views, else there are fewer bands.
    """
    depths = corner_depths(corners, state)
    near, far = float(depths.min()), float(depths.max())
    if not near > 0 or far < _LEAST_DEPTH_RATIO * near:
        return None
    views = corners.view_of_each
    for count in range(most, 1, -1):
        middles = 1 / np.linspace(1 / near, 1 / far, count)
        nears = np.concatenate([middles[:1], middles[:-1]])
        fars = np.concatenate([middles[1:], middles[-1:]])
        inside = [(depths >= a) & (depths <= b) for a, b in zip(nears, fars, strict=True)]
        if all(i.sum() >= _LEAST_CORNERS and len(np.unique(views[i])) >= _LEAST_VIEWS for i in inside):
            return nears, fars
    return None
