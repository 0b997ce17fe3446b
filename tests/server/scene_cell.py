"""A small session with a solved sphere, made by hand so that every residual in it is known."""

import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import uvicorn
from fastapi import FastAPI

from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import Capture, Measured, VarianceComponents, parse_session
from calib_core.stages.tcp.record import TcpResult, TwoStep
from server.http import errors
from server.scenes.manager import SceneManager
from server.scenes.router import scenes_router
from server.scenes.scene_input import SceneInput

RADIUS_MM = 20.0
CENTER_MM = np.array([820.0, -240.0, 310.0])
TOOL0_FROM_LASER = RigidTransform.of([0.35, -0.5, 1.2], [35.0, -120.0, 140.0], "tool0", "laser")


@dataclass(frozen=True, eq=False)
class SceneCell:
    """A session's parts, to be put together with or without its result."""

    poses: list[RigidTransform]
    points: list[FloatArray]
    residuals: list[FloatArray]
    rejected: tuple[str, ...]

    def scene(
        self, *, count: int | None = None, solved: bool = True, failed: tuple[str, ...] = (), name: str = "cell 4"
    ) -> SceneInput:
        count = len(self.poses) if count is None else count
        ids = [f"p{k + 1:02d}" for k in range(count)]
        session = parse_session(
            {
                "format": "scancell-session/1",
                "name": name,
                "cell": {"sphere_diameter_mm": 2 * RADIUS_MM, "pose_convention": "matrix"},
                "captures": [
                    {
                        "id": i,
                        "step": "tcp",
                        "kind": "profile",
                        "files": [f"captures/{i}.csv"],
                        "pose": pose.matrix.ravel().tolist(),
                    }
                    for i, pose in zip(ids, self.poses, strict=False)
                ],
            }
        )
        points = dict(zip(ids, self.points, strict=False))
        measured = [
            Measured(
                capture=i,
                kind="profile",
                verdict="fail" if i in failed else "pass",
                reason="The sphere leaves the stripe at the left. Move 12 mm to −x." if i in failed else None,
            )
            for i in ids
        ]

        def load(capture: Capture) -> FloatArray:
            return points[capture.id]

        results = {"tcp": self.result(ids)} if solved else {}
        return SceneInput(session, load, measured, results)

    def result(self, ids: list[str]) -> TcpResult:
        rows = [
            {"capture": i, "used": False, "reason": "sphere moved by 3.0 mm. Take it again."}
            if i in self.rejected
            else {"capture": i, "used": True}
            for i in ids
        ]
        return TcpResult.model_validate(
            {
                "method": "joint",
                "software": "scancell",
                "inputs_sha256": "0" * 64,
                "verdict": "pass",
                "tool0_from_laser": TOOL0_FROM_LASER.to_rows(),
                "covariance": np.zeros((6, 6)).tolist(),
                "sphere_center_in_base_mm": CENTER_MM.tolist(),
                "sphere_center_covariance": np.zeros((3, 3)).tolist(),
                "surface_rms_mm": 0.02,
                "leave_one_out_surface_rms_mm": 0.03,
                "center_scatter_rms_mm": 0.05,
                "two_step": TwoStep(),
                "variance_components": VarianceComponents(
                    point_sigma_mm=0.02,
                    position_sigma_mm=0.05,
                    orientation_sigma_rad=0.0,
                    orientation_sigma_deg=0.0,
                ),
                "residuals": rows,
            }
        )


def make_cell(
    count: int = 14, seed: int = 4, points: int = 300, rejected: tuple[str, ...] = ("p05",)
) -> SceneCell:
    """Return a cell whose scanner looks at the sphere from `count` places above it."""
    rng = np.random.default_rng(seed)
    poses, clouds, residuals = [], [], []
    for k in range(count):
        laser = _looking_down(rng, along_mm=rng.uniform(-20, 20), away_mm=rng.uniform(150, 230))
        offset = rng.normal(0, 0.05)
        shift = 3.0 if f"p{k + 1:02d}" in rejected else 0.0
        cloud, deviation = _profile(rng, laser, points, offset + shift)
        poses.append(laser @ TOOL0_FROM_LASER.inverse())
        clouds.append(cloud)
        residuals.append(deviation)
    return SceneCell(poses, clouds, residuals, rejected)


def _looking_down(rng: np.random.Generator, along_mm: float, away_mm: float) -> RigidTransform:
    """Return base_from_laser with the sphere at (along, y, away) in L and L's z roughly downwards."""
    down = RigidTransform.of([np.pi, 0, 0], [0, 0, 0], "base", "base")
    turn = RigidTransform.of(rng.uniform(-0.6, 0.6, 3), [0, 0, 0], "base", "laser")
    rotation = (down @ turn).rotation
    y = rng.choice([-1, 1]) * rng.uniform(0.2, 0.8) * RADIUS_MM
    return RigidTransform.of(rotation, CENTER_MM - rotation @ [along_mm, y, away_mm], "base", "laser")


def _profile(
    rng: np.random.Generator, laser: RigidTransform, count: int, offset_mm: float
) -> tuple[FloatArray, FloatArray]:
    """Return points (N, 3) on the arc that the plane y = 0 cuts, at known distances (N,) from the sphere."""
    center = laser.inverse().apply(CENTER_MM)
    deviation = offset_mm + rng.normal(0, 0.02, count)
    radius = np.sqrt((RADIUS_MM + deviation) ** 2 - center[1] ** 2)
    angle = np.deg2rad(rng.uniform(-65, 65, count))
    points = np.stack([radius * np.sin(angle), np.zeros(count), -radius * np.cos(angle)], axis=1)
    return points + np.array([center[0], 0.0, center[2]]), deviation


@contextmanager
def serve_scenes(manager: SceneManager) -> Generator[str]:
    """Serve the scenes alone, on loopback; gives the address."""
    app = FastAPI()
    errors.install(app)
    app.state.scenes = manager
    app.include_router(scenes_router)
    config = uvicorn.Config(app, port=0, log_level="warning", lifespan="off", timeout_graceful_shutdown=5)
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        wait_until(lambda: server.started)
        yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join(20)
        assert not thread.is_alive(), "the server does not stop"


def wait_until(true: Callable[[], bool]) -> None:
    end = time.monotonic() + 300
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)
