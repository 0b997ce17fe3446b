"""What a scene has read of a session is kept while it is open: reading it again at each change would take long."""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from calib_core.frames import FloatArray
from calib_core.records import Capture
from server.scenes.merged import KnownScans
from server.scenes.scene_input import SceneInput

Read = TypeVar("Read")


class Kept:
    """The last thing that was read of each kind, with what it was read from."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[object, object]] = {}

    def of(self, kind: str, basis: object, load: Callable[[], Read]) -> Callable[[], Read]:
        """Return the same loader, which reads again only where its basis is another one."""

        def kept() -> Read:
            known = self._known.get(kind)
            if known is None or known[0] != basis:
                known = (basis, load())
                self._known[kind] = known
            return known[1]  # pyright: ignore[reportReturnType] what stands there came from this loader

        return kept


class PointCache:
    """Keeps every capture's points, and merged cloud, scans and reference as long as what they come from."""

    def __init__(self) -> None:
        self._points: dict[str, tuple[Capture, FloatArray]] = {}
        self._scans: KnownScans = {}
        self._kept = Kept()

    def on(self, scene: SceneInput) -> SceneInput:
        """Return the same input with its loaders remembered; captures that are gone are forgotten."""
        present = {capture.id for capture in scene.session.captures}
        for capture_id in [known for known in self._points if known not in present]:
            del self._points[capture_id]

        def load(capture: Capture) -> FloatArray:
            known = self._points.get(capture.id)
            if known is None or known[0] != capture:
                known = (capture, scene.load_points(capture))
                self._points[capture.id] = known
            return known[1]

        solved = tuple(f"{stage} {result.inputs_sha256}" for stage, result in scene.results.items())
        scans = tuple(capture for capture in scene.session.captures if capture.step == "scan")
        of = self._kept.of
        return replace(
            scene,
            load_points=load,
            load_scans=of("scans", (solved, scans), lambda: scene.load_scans(self._scans)),
            load_merged=of("merged", (solved, scene.outputs), scene.load_merged),
            load_reference=of("reference", (solved, scene.outputs), scene.load_reference),
        )
