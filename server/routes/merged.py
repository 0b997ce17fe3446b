"""The merged cloud looked into: sections, deviations from a reference, and the reference itself."""

from typing import Annotated, Literal

import numpy as np
from fastapi import File, Query, Response, UploadFile
from numpy.typing import NDArray
from pydantic import FiniteFloat

from calib_core.errors import InputError, NotFoundError
from calib_core.messages import message
from calib_core.stages.merge.record import MergeResult
from server.http.api_router import API, api_router
from server.http.schemas import CloudDeviations, CloudSection, ReferenceMesh
from server.routes.dependencies import LoadedSession, SessionId, StoreDep
from server.scenes.cloud_view import AXES, Against, Section, section_of
from server.scenes.deviation import CloudDeviation, cloud_deviation
from server.scenes.deviation import ReferenceMesh as Reference
from server.scenes.merged import MergedScans, merged_cloud, thinned
from server.scenes.stored import reference_mesh
from server.store.process_data import Output
from server.store.references import set_reference
from server.store.session_answer import stage_headers
from server.store.sessions import StoredSession, load_session, locked_session
from server.store.unreferenced import remove_unreferenced

router = api_router("clouds", f"{API}/sessions/{{session_id}}")

_MOST_POINTS = 4000
_MOST_LINES = 8000
_METRES = 0.02  # a reference this much smaller than what was scanned is in another unit

Kind = Annotated[
    Literal["mesh", "sphere"], Query(description="The stored reference mesh, or the sphere in the cloud.")
]
Diameter = Annotated[
    float | None, Query(gt=0, le=10_000, description="The sphere's, where it is known; else the best fit's.")
]


@router.get("/merged/section", response_model=CloudSection, response_model_exclude_none=True)
def section(
    stored: LoadedSession,
    response: Response,
    axis: Annotated[Literal["x", "y", "z"], Query(description="The axis that the plane cuts.")] = "z",
    at_mm: Annotated[float, Query(allow_inf_nan=False, description="Where, in the cloud's frame.")] = 0.0,
    normal: Annotated[
        list[FiniteFloat] | None,
        Query(min_length=3, max_length=3, description="Cuts across this direction instead of an axis."),
    ] = None,
    width_mm: Annotated[float, Query(gt=0, le=100, description="The slice's thickness.")] = 1.0,
    against: Annotated[Literal["mesh", "sphere"] | None, Query(description="Gives deviations, too.")] = None,
    diameter_mm: Diameter = None,
) -> CloudSection:
    """Return the points of the merged cloud in a thin slice, at most four thousand of them."""
    merged = _merged(stored)
    response.headers.update(stage_headers(stored, "merge"))
    assert merged.every_mm is not None
    cut = section_of(axis, at_mm, normal=normal)
    inside = merged.every_mm[np.abs(cut.along_mm(merged.every_mm) - at_mm) <= width_mm / 2]
    shown = thinned(inside, _MOST_POINTS)
    flat = cut.directions[:2]
    seen = merged.points_mm @ flat.T
    deviation = None if against is None else _deviation(stored, merged, Against(against, diameter_mm))
    return CloudSection(
        frame=merged.frame,
        axis=axis if normal is None else None,
        at_mm=at_mm,
        width_mm=width_mm,
        across=["u", "v"] if normal is not None else [other for other in AXES if other != axis],
        directions=cut.directions.tolist(),
        low_mm=seen.min(axis=0).astype(float).tolist(),
        high_mm=seen.max(axis=0).astype(float).tolist(),
        count=len(inside),
        points=(shown @ flat.T).astype(float).round(3).tolist(),
        deviations_mm=None if deviation is None else _numbers(deviation.of(shown)),
        nominal=_nominal(stored, cut) if against == "mesh" else None,
        limit_mm=None if deviation is None else deviation.limit_mm,
    )


@router.get("/merged/deviation", response_model=CloudDeviations, response_model_exclude_none=True)
def deviation(
    stored: LoadedSession, response: Response, against: Kind = "mesh", diameter_mm: Diameter = None
) -> CloudDeviations:
    """Return how far the merged cloud lies off the reference mesh or the sphere in it, as it was placed."""
    from calib_core.fusion.deviation import histogram

    seen = _deviation(stored, _merged(stored), Against(against, diameter_mm))
    response.headers.update(stage_headers(stored, "merge"))
    found = seen.found
    return CloudDeviations(
        against=against,
        reference=seen.words,
        counted=found.counted,
        mean_mm=found.mean_mm,
        rms_mm=found.rms_mm,
        p95_mm=found.largest_mm(0.95),
        largest_mm=found.largest_mm(1.0),
        limit_mm=seen.limit_mm,
        histogram=histogram(found.values_mm, seen.limit_mm).tolist(),
        center_mm=None if found.center_mm is None else found.center_mm.tolist(),
        diameter_mm=None if found.radius_mm is None else 2 * found.radius_mm,
    )


@router.put("/merged/reference", response_model=ReferenceMesh)
def put_reference(
    session_id: SessionId,
    store: StoreDep,
    file: Annotated[
        UploadFile,
        File(
            description="STL, PLY or OBJ, in mm, in any place: the next merge aligns it.",
            examples=["solid part\n…"],
        ),
    ],
) -> ReferenceMesh:
    """Store the mesh that says what the object should be, in place of the one before."""
    from calib_core.formats.meshes import parse_mesh
    from calib_core.formats.ply import ply_pieces

    with store.read() as db:
        merge = load_session(db, store.blobs, session_id).results.get("merge")
    mesh = parse_mesh(file.file.read(), file.filename or "reference")
    low, high = mesh.corners_mm.min(axis=0), mesh.corners_mm.max(axis=0)
    if merge is not None:
        _require_millimetres(float(np.linalg.norm(high - low)), MergeResult.model_validate(merge))
    sha256, size = store.blobs.put_pieces(ply_pieces(mesh.corners_mm, triangles=mesh.triangles))
    _replace_reference(store, session_id, Output(sha256, size))
    return ReferenceMesh(
        triangles=len(mesh.triangles),
        low_mm=low.astype(float).tolist(),
        high_mm=high.astype(float).tolist(),
        sha256=sha256,
    )


@router.delete("/merged/reference", status_code=204)
def delete_reference(session_id: SessionId, store: StoreDep) -> Response:
    """Forget the reference mesh, if there is one."""
    _replace_reference(store, session_id, None)
    return Response(status_code=204)


def _replace_reference(store: StoreDep, session_id: str, reference: Output | None) -> None:
    with store.write() as db:
        gone = set_reference(db, locked_session(db, session_id), reference)
    remove_unreferenced(store, gone)


def _merged(stored: StoredSession) -> MergedScans:
    results = {"merge": MergeResult.model_validate(stored.results["merge"])} if "merge" in stored.results else {}
    merged = merged_cloud(results, stored.read_output)
    if merged is None:
        to_do = message("POST …/sessions/{stored}/solve/merge makes it.", stored=stored.id)
        raise NotFoundError("a merged cloud", "none", to_do, "merge")
    return merged


def _nominal(stored: StoredSession, cut: Section) -> list[list[float]]:
    """Return the reference mesh cut by a plane, as lines in its axes; every so many where there are very many."""
    from calib_core.fusion.deviation import plane_cut

    mesh = reference_mesh(stored.session, stored.read_output, stored.results.get("merge"))
    assert mesh is not None, "deviations from it were given"
    lines = plane_cut(mesh.corners_mm @ cut.directions.T, mesh.triangles, cut.at_mm)
    return thinned(lines.reshape(-1, 4), _MOST_LINES).round(3).tolist()


def _deviation(stored: StoredSession, merged: MergedScans, against: Against) -> CloudDeviation:
    reference: Reference | None = None
    if against.kind == "mesh":
        reference = reference_mesh(stored.session, stored.read_output, stored.results.get("merge"))
        if reference is None:
            to_do = message("PUT …/merged/reference with an STL, PLY or OBJ file, or compare with the sphere.")
            raise NotFoundError("a reference mesh", "none", to_do, "against")
    return cloud_deviation(merged.points_mm, against, reference)


def _require_millimetres(extent_mm: float, merge: MergeResult) -> None:
    scanned_mm = float(np.linalg.norm(np.subtract(merge.high_mm, merge.low_mm)))
    if extent_mm < _METRES * scanned_mm or extent_mm > scanned_mm / _METRES:
        need = "a reference of about the size of what was scanned ({scanned_mm:.0f} mm across)"
        to_do = "Export it in millimetres."
        raise InputError(
            need, "one of {extent_mm:.3g} mm", to_do, "file", scanned_mm=scanned_mm, extent_mm=extent_mm
        )


def _numbers(values: NDArray[np.float64]) -> list[float | None]:
    return [round(value, 4) if np.isfinite(value) else None for value in values.tolist()]
