"""The scene with the merged part in the real Chromium, drawn in software: its first picture, the points sent."""

from functools import partial
from typing import Any

import numpy as np
from harness import Row
from playwright.sync_api import sync_playwright

from calib_core.archive.stored_clouds import CLOUD_FILE, read_stored_ply
from calib_core.formats.ply import ply_pieces
from calib_core.simulation import simulate
from calib_core.stages.pipeline import run as solve
from server.scenes.merged import merged_cloud
from server.scenes.scene_input import SceneInput
from server.scenes.stored import scene_input
from tests.server.scene_visit import ARGUMENTS, FirstPicture, visit
from tests.web.browsing import CHROMIUM

MOST_S, MOST_POINTS = 5.0, 1_000_000


def merged_cell(seed: int = 7) -> tuple[SceneInput, dict[str, bytes]]:
    """Return the scene of the simulated cell's whole chain with its merged part, and the stored files by name."""
    simulated = simulate("cell", seed)
    files: dict[str, bytes] = {}

    def store(name: str, pieces: Any) -> None:
        files[name] = b"".join(bytes(piece) for piece in pieces)

    results = solve(simulated.session, simulated.files.__getitem__, store=store)
    data = {stage: result.to_json() for stage, result in results.items()}
    return scene_input(simulated.session, simulated.files.__getitem__, [], data, files.get), files


def enlarged(scene: SceneInput, files: dict[str, bytes], count: int) -> SceneInput:
    """Return the same scene with so many points in its merged cloud, each a neighbour of one that was there."""
    points = read_stored_ply(files[CLOUD_FILE], CLOUD_FILE).points_mm
    rng = np.random.default_rng(1)
    more = points[rng.integers(0, len(points), count)] + rng.normal(0, 0.1, (count, 3)).astype(np.float32)
    stored = {CLOUD_FILE: b"".join(bytes(piece) for piece in ply_pieces(more))}
    return SceneInput(
        scene.session,
        scene.load_points,
        scene.measured,
        scene.results,
        scene.load_scans,
        partial(merged_cloud, scene.results, stored.get),
    )


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` also draws a cloud of five million points."""
    scene, files = merged_cell()
    cases = {"merged part": scene}
    if full:
        cases["merged cloud of 5,000,000 points"] = enlarged(scene, files, 5_000_000)
    rows: list[Row] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(ARGUMENTS))
        for what, one in cases.items():
            seen = [visit(browser, one) for _ in range(3 if full else 1)]
            shot = [visit(browser, one, "screenshots") for _ in range(3 if full else 1)]
            points, megabytes = max(s.points for s in seen), max(s.bytes for s in seen) / 1e6
            rows += [
                Row(f"{what}: first picture, worst of {len(seen)}", f"< {MOST_S:g} s", *_time(seen)),
                Row(
                    f"{what}: the same, slowed by one screenshot after the other",
                    "to compare",
                    _time(shot)[0],
                    True,
                ),
                Row(
                    f"{what}: points sent",
                    f"≤ {MOST_POINTS:,}",
                    f"{points:,} ({megabytes:.1f} MB)",
                    points <= MOST_POINTS,
                ),
            ]
        browser.close()
    return rows


def _time(seen: list[FirstPicture]) -> tuple[str, bool]:
    """Return the slowest in words, and whether it is soon enough."""
    worst = max(seen, key=lambda picture: picture.seconds)
    more = f"presented after {worst.presented_s:.2f} s, {worst.processor_s:.1f} s of processors"
    return f"{worst.seconds:.2f} s ({more})", worst.seconds < MOST_S
