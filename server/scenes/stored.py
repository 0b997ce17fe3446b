"""Where scenes get their sessions from: the store, or a session folder that was read."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from calib_core.captures.content import shows_sphere
from calib_core.captures.observe import observe_capture
from calib_core.captures.stripe_frames import with_solved_calibration
from calib_core.errors import CalibrationError, NotFoundError
from calib_core.frames import FloatArray
from calib_core.graph.registry import stages
from calib_core.records import Capture, Measured, ReadFile, ResultsData, Session
from server.scenes.deviation import ReferenceMesh
from server.scenes.merged import ReadOutput, merged_cloud, merged_scans
from server.scenes.scene_input import SceneInput

if TYPE_CHECKING:
    from server.http.events import Hub
    from server.store.database import Store
    from server.store.models import EventRow
    from server.store.sessions import StoredSession


def scene_input(
    session: Session,
    read: ReadFile,
    measured: Iterable[Measured],
    results: ResultsData,
    read_output: ReadOutput = lambda _name: None,
) -> SceneInput:
    """Return what a session's scene is drawn from.

    Parameters
    ----------
    session : Session
    read : callable
        Returns the bytes of a file by its name in a capture.
    measured : iterable of Measured
    results : mapping
        From stage to the result, as JSON data.
    read_output : callable, optional
        Returns the bytes of a file that a stage made beside its result, None where there is none.
    """

    calibrated = with_solved_calibration(session.model_copy(update={"captures": []}), results)

    def points_on_sphere(capture: Capture) -> FloatArray:
        if not shows_sphere(capture) or capture.kind not in ("profile", "cloud", "frame"):
            return np.zeros((0, 3))
        try:
            return observe_capture(calibrated, capture, read).points_in_laser_mm
        except CalibrationError:
            return np.zeros((0, 3))  # its measurement has said why, and the scene shows that

    solved = {
        stage.name: stage.result.model_validate(results[stage.name]) for stage in stages() if stage.name in results
    }
    return SceneInput(
        session,
        points_on_sphere,
        tuple(measured),
        solved,
        partial(merged_scans, session, solved, read),
        partial(merged_cloud, solved, read_output),
        partial(reference_mesh, session, read_output, results.get("merge")),
    )


def reference_mesh(
    session: Session, read_output: ReadOutput, merge: Mapping[str, Any] | None
) -> ReferenceMesh | None:
    """Return the nominal part that the user gave, where the merge aligned it; None where there is none."""
    from calib_core.archive.stored_clouds import REFERENCE_FILE
    from calib_core.formats.meshes import parse_mesh
    from calib_core.stages.merge.nominal import cloud_from_reference

    name = session.cell.merge.reference or REFERENCE_FILE
    data = read_output(name)
    if data is None:
        return None
    mesh = parse_mesh(data, name)
    pose = cloud_from_reference(merge, data)
    tolerance_mm = ((merge or {}).get("deviation") or {}).get("tolerance_mm")
    voxel_mm = (merge or {}).get("voxel_mm")
    return ReferenceMesh(mesh.corners_mm @ pose[:3, :3].T + pose[:3, 3], mesh.triangles, tolerance_mm, voxel_mm)


def stored_scene(store: "Store", session_id: str) -> SceneInput | None:
    """Return a stored session as its scene needs it, None where there is none."""
    from server.store.sessions import load_session

    try:
        with store.read() as db:
            stored = load_session(db, store.blobs, session_id)
    except NotFoundError:
        return None
    return scene_of(stored)


def scene_of(stored: "StoredSession") -> SceneInput:
    """Return a session of the store as its scene needs it."""
    scene = scene_input(
        stored.session, stored.reader, stored.measured.values(), stored.results, stored.read_output
    )
    outputs = tuple(f"{name} {output.sha256}" for name, output in stored.outputs.items())
    return replace(scene, outputs=outputs, stale=frozenset(stored.stale))


def follow_scene(hub: "Hub", session_id: str, changed: Callable[[], None]) -> Callable[[], None]:
    """Call `changed` at each event that a session's scene shows, or one of its past; returns what ends that."""

    def listen(event: "EventRow") -> None:
        if event.kind in ("capture", "result", "session"):
            changed()

    return hub.subscribe(session_id.partition(".")[0], listen)
