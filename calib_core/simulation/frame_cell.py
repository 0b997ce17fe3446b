"""The simulated cell with a raw camera and a line laser on the flange: frames of boards and of the sphere."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from calib_core.records import Capture, Session
from calib_core.simulation.frame_camera import SimulatedCamera
from calib_core.simulation.frame_surfaces import BoardKind, BoardSurface, SphereSurface
from calib_core.simulation.frames import Exposure, FloatArray, ImageArray, LightSheet, render
from calib_core.simulation.motion import ON_FLANGE, back, pose, turn
from calib_core.simulation.profile_cell import pose_numbers, rounded_pose

_SPHERE_RADIUS_MM = 30.0
_PITCH_MM = 9.0
_OF_CELL = 31_415  # a cell's own numbers, apart from others of its seed
_ANYWHERE = 3.0  # boards beyond the usual places, as far as the frame's border
_MARKER_MM = 7.5
_SPHERE_IN_BASE_MM = np.array([900.0, 150.0, 400.0])
TOOL0_FROM_CAMERA = pose(turn([0.35, -0.2, 1.1]), [42.0, -75.0, 60.0])


@dataclass(frozen=True)
class FrameScenario:
    """A session of frames.

    Parameters
    ----------
    description : str
    camera_views, plane_views : int
        Boards for the camera; boards with the stripe, of which every second comes as two frames, lit and stripe.
    translations, orientations : int
        Frames of the sphere: at one orientation, and at orientations of their own.
    tilt_rad : (about x, about y)
        The sensor's tilt; the plane in focus is then the plane of light.
    knows_calibration : bool
        Whether the session brings camera and plane of light as `cell.known`.
    hot_pixels : int
    position_sigma_mm, orientation_sigma_rad : float
        The robot's pose errors.
    board : {"chessboard", "charuco", "circles", "asymmetric-circles"}
    spread : float
        How far from the view's middle the camera's boards are held; at 1 they stay near it.
    """

    description: str
    camera_views: int = 0
    plane_views: int = 0
    translations: int = 0
    orientations: int = 0
    tilt_rad: tuple[float, float] = (0.0, 0.0)
    knows_calibration: bool = False
    hot_pixels: int = 80
    position_sigma_mm: float = 0.05
    orientation_sigma_rad: float = 0.0002
    board: BoardKind = "chessboard"
    spread: float = 1.0


FRAME_SCENARIOS: Mapping[str, FrameScenario] = MappingProxyType(
    {
        "camera": FrameScenario("14 views of a chessboard", camera_views=14),
        "camera-tilted": FrameScenario(
            "16 views of a chessboard by a camera with a tilted sensor", camera_views=16, tilt_rad=(0.08, 0.01)
        ),
        "camera-charuco": FrameScenario("14 views of a ChArUco board", camera_views=14, board="charuco"),
        "camera-circles": FrameScenario("14 views of a grid of circles", camera_views=14, board="circles"),
        "laser-plane": FrameScenario(
            "10 boards for the camera, 8 with the stripe", camera_views=10, plane_views=8
        ),
        "frames-tcp": FrameScenario(
            "raw frames all the way: boards, boards with the stripe, 14 frames of the sphere",
            camera_views=10,
            plane_views=8,
            translations=4,
            orientations=10,
            spread=2.8,
        ),
        "frames-tcp-known": FrameScenario(
            "14 frames of the sphere; camera and plane of light are brought along",
            translations=4,
            orientations=10,
            knows_calibration=True,
        ),
    }
)


@dataclass(frozen=True, eq=False)
class FrameCell:
    """What is true of a simulated cell with a raw camera; transforms are 4×4, mm."""

    camera: SimulatedCamera
    sheet: LightSheet
    camera_from_laser: FloatArray

    @property
    def mount_from_laser(self) -> FloatArray:
        """The frame L on the flange."""
        return TOOL0_FROM_CAMERA @ self.camera_from_laser

    def truth(self) -> dict[str, Any]:
        """Return the truth as JSON data."""
        return {
            "camera": self.known_camera(),
            "plane_in_camera": {"normal": self.sheet.normal.tolist(), "distance_mm": self.sheet.distance_mm},
            "camera_from_laser": self.camera_from_laser.tolist(),
            ON_FLANGE: self.mount_from_laser.tolist(),
            "sphere_center_in_base_mm": _SPHERE_IN_BASE_MM.tolist(),
            "sphere_diameter_mm": 2 * _SPHERE_RADIUS_MM,
        }

    def known_camera(self) -> dict[str, Any]:
        """Return the camera as `cell.known` writes it."""
        c = self.camera
        (fx, fy), (cx, cy) = c.focal_px, c.center_px
        names = ("k1", "k2", "k3", "k4", "k5", "k6")
        distortion = {
            **dict(zip(names, c.radial, strict=False)),
            "p1": c.tangential[0],
            "p2": c.tangential[1],
            **({"tauX": c.tilt_rad[0], "tauY": c.tilt_rad[1]} if any(c.tilt_rad) else {}),
        }
        return {"camera_matrix": [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], "distortion": distortion}


def build_cell(options: FrameScenario, rng: np.random.Generator) -> FrameCell:
    """Return a cell whose lens and laser differ a little from seed to seed."""
    focal = 900.0 + rng.uniform(-15, 15)
    camera = SimulatedCamera(
        focal_px=(focal, focal * (1 + rng.uniform(-0.003, 0.003))),
        center_px=(319.5 + rng.uniform(-6, 6), 239.5 + rng.uniform(-6, 6)),
        radial=(-0.12 + rng.uniform(-0.02, 0.02), 0.08 + rng.uniform(-0.02, 0.02), 0.0),
        tangential=(rng.uniform(-4e-4, 4e-4), rng.uniform(-4e-4, 4e-4)),
        tilt_rad=options.tilt_rad,
    )
    lean = 0.5 + rng.uniform(-0.03, 0.03)
    roll = rng.uniform(-0.03, 0.03)
    normal = np.array([np.sin(roll) * np.cos(lean), np.cos(roll) * np.cos(lean), np.sin(lean)])
    distance = 120.0 + rng.uniform(-2, 2)
    # L: origin at the plane's point nearest to the camera, z the viewing direction laid into the plane.
    z_axis = np.array([0, 0, 1.0]) - normal[2] * normal
    z_axis /= np.linalg.norm(z_axis)
    rotation = np.column_stack([np.cross(normal, z_axis), normal, z_axis])
    return FrameCell(camera, LightSheet(normal, distance, distance * normal), pose(rotation, distance * normal))


def _board(kind: BoardKind, camera_from_board: FloatArray) -> BoardSurface:
    """Return a board of about nine by six pitches; of a ChArUco board the squares count, and are larger."""
    if kind == "charuco":
        return BoardSurface(camera_from_board, 8, 6, _PITCH_MM + 2.0, kind, marker_mm=_MARKER_MM)
    columns, rows = (5, 9) if kind == "asymmetric-circles" else (9, 6)
    return BoardSurface(camera_from_board, columns, rows, _PITCH_MM, kind)


def board_views(
    count: int, rng: np.random.Generator, kind: BoardKind = "chessboard", spread: float = 1.0
) -> list[BoardSurface]:
    """Return boards at random places that fill the view between 200 and 310 mm, `spread` times as wide."""
    boards: list[BoardSurface] = []
    for index in range(count):
        depth = 205.0 + 100.0 * (index % 5) / 4 + rng.uniform(-5, 5)
        rotation = turn(rng.uniform(-1, 1, 3) * [0.45, 0.45, 0.3])
        middle = _board(kind, np.eye(4)).points_on_board_mm().mean(axis=0)
        offset = rng.uniform(-1, 1, 2) * [0.07 * spread, 0.05 * spread] * depth
        place = pose(rotation, np.array([*offset, depth]) - rotation @ middle)
        boards.append(_board(kind, place))
    return boards


def simulate_frames(
    options: FrameScenario, name: str, seed: int
) -> tuple[Session, dict[str, bytes], dict[str, Any]]:
    """Return the session record, its files and the truth of a scenario of frames."""
    rng = np.random.default_rng([seed, _OF_CELL])
    cell = build_cell(options, rng)
    truth = {**cell.truth(), "seed": seed, "scenario": name, "base_from_tool0": {}}
    truth["sigmas"] = {
        "position_sigma_mm": options.position_sigma_mm,
        "orientation_sigma_rad": options.orientation_sigma_rad,
    }
    files: dict[str, bytes] = {}
    captures = [
        *_camera_captures(cell, options, rng, files),
        *_plane_captures(cell, options, rng, files),
        *_sphere_captures(cell, options, rng, files, truth),
    ]
    data = {
        "format": "scancell-session/1",
        "name": f"simulated {name}, seed {seed}",
        "cell": cell_record(cell, options),
        "captures": captures,
    }
    return Session.model_validate(data), files, truth


def one_more_frame(
    scenario: str, seed: int, step: str, name: str, rng: np.random.Generator
) -> tuple[Capture, dict[str, bytes]] | None:
    """Return another capture of a step, boards anywhere in the view; None where the cell has none."""
    options = FRAME_SCENARIOS[scenario]
    cell = build_cell(options, np.random.default_rng([seed, _OF_CELL]))
    one = replace(options, camera_views=1, plane_views=1, translations=0, orientations=1, spread=_ANYWHERE)
    files: dict[str, bytes] = {}
    truth: dict[str, Any] = {"base_from_tool0": {}}
    if step == "camera":
        (record,) = _camera_captures(cell, one, rng, files)
    elif step == "laser-plane":
        (record,) = _plane_captures(cell, one, rng, files)
    elif step in ("tcp", "verify") and (options.translations or options.orientations):
        (record,) = _sphere_captures(cell, one, rng, files, truth)
    else:
        return None
    names = {file: f"captures/{name}{file.removeprefix('captures/' + record['id'])}" for file in files}
    told = {**record, "id": name, "step": step, "files": [names[file] for file in record["files"]]}
    return Capture.model_validate(told), {names[file]: content for file, content in files.items()}


def cell_record(cell: FrameCell, options: FrameScenario) -> dict[str, Any]:
    """Return the cell's record, with what the scenario says is brought along."""
    record: dict[str, Any] = {
        "pose_convention": "abb",
        "scanner": {"kind": "frame"},
        "board": _board_record(options.board),
    }
    if options.translations or options.orientations:
        record["sphere_diameter_mm"] = 2 * _SPHERE_RADIUS_MM
        record["robot"] = {
            "position_sigma_mm": options.position_sigma_mm,
            "orientation_sigma_deg": float(np.rad2deg(options.orientation_sigma_rad)),
        }
    if options.knows_calibration:
        plane = {"normal": cell.sheet.normal.tolist(), "distance_mm": cell.sheet.distance_mm}
        record["known"] = {"camera": cell.known_camera(), "laser_plane": plane}
    return record


def _board_record(kind: BoardKind) -> dict[str, Any]:
    board = _board(kind, np.eye(4))
    record = {"kind": kind, "columns": board.columns, "rows": board.rows, "pitch_mm": board.pitch_mm}
    return record | ({"marker_mm": _MARKER_MM, "dictionary": board.dictionary} if kind == "charuco" else {})


def exposure_for(options: FrameScenario, cell: FrameCell, ambient: float) -> Exposure:
    """Return how a frame is exposed under some room light; a tilted sensor has the plane of light in focus."""
    even = Exposure(ambient=ambient, hot_pixels=options.hot_pixels)
    if not any(options.tilt_rad):
        return even
    x, y, z = cell.sheet.normal.tolist()
    return replace(even, focus_normal=(x, y, z), focus_distance_mm=cell.sheet.distance_mm)


def _camera_captures(
    cell: FrameCell, options: FrameScenario, rng: np.random.Generator, files: dict[str, bytes]
) -> list[dict[str, Any]]:
    captures: list[dict[str, Any]] = []
    for index, board in enumerate(board_views(options.camera_views, rng, options.board, options.spread)):
        name = f"captures/c{index + 1:02d}.png"
        files[name] = as_png(render(cell.camera, [board], None, exposure_for(options, cell, 190.0), rng))
        captures.append({"id": f"c{index + 1:02d}", "step": "camera", "kind": "frame", "files": [name]})
    return captures


def _plane_captures(
    cell: FrameCell, options: FrameScenario, rng: np.random.Generator, files: dict[str, bytes]
) -> list[dict[str, Any]]:
    captures: list[dict[str, Any]] = []
    for index, board in enumerate(board_views(options.plane_views, rng, options.board)):
        label = f"l{index + 1:02d}"
        frames = {f"captures/{label}.png": (90.0, cell.sheet)}
        if index % 2:
            frames = {
                f"captures/{label}-lit.png": (190.0, None),
                f"captures/{label}-stripe.png": (4.0, cell.sheet),
            }
        for name, (ambient, sheet) in frames.items():
            files[name] = as_png(render(cell.camera, [board], sheet, exposure_for(options, cell, ambient), rng))
        captures.append({"id": label, "step": "laser-plane", "kind": "frame", "files": list(frames)})
    return captures


def _sphere_captures(
    cell: FrameCell,
    options: FrameScenario,
    rng: np.random.Generator,
    files: dict[str, bytes],
    truth: dict[str, Any],
) -> list[dict[str, Any]]:
    captures: list[dict[str, Any]] = []
    nominal = turn([3.0, 0.2, -0.4])
    for index in range(options.translations + options.orientations):
        label = f"p{index + 1:02d}"
        turned = index >= options.translations
        rotation = nominal @ turn(rng.uniform(-0.6, 0.6, 3)) if turned else nominal
        # Beyond the plane, as the camera sees it: then the stripe lies on the sphere's near side.
        offset = rng.uniform(0.15, 0.8) * _SPHERE_RADIUS_MM
        in_laser = np.array([rng.uniform(-25, 25), offset, rng.uniform(200, 260), 1.0])
        in_tool0 = (cell.mount_from_laser @ in_laser)[:3]
        reported = rounded_pose(pose(rotation, _SPHERE_IN_BASE_MM - rotation @ in_tool0))
        actual = pose(
            reported[:3, :3] @ turn(rng.normal(0, options.orientation_sigma_rad, 3)),
            reported[:3, 3] + rng.normal(0, options.position_sigma_mm, 3),
        )
        camera_from_base = back(actual @ TOOL0_FROM_CAMERA)
        center = camera_from_base[:3, :3] @ _SPHERE_IN_BASE_MM + camera_from_base[:3, 3]
        sphere = SphereSurface(center, _SPHERE_RADIUS_MM)
        name = f"captures/{label}.png"
        files[name] = as_png(render(cell.camera, [sphere], cell.sheet, exposure_for(options, cell, 8.0), rng))
        truth["base_from_tool0"][label] = actual.tolist()
        numbers = pose_numbers(reported)
        captures.append({"id": label, "step": "tcp", "kind": "frame", "files": [name], "pose": numbers})
    return captures


def as_png(image: ImageArray) -> bytes:
    """Return a frame as the bytes of a PNG file."""
    import cv2

    return bytes(cv2.imencode(".png", image)[1].tobytes())
