"""`scancell merge`: scans whose poses are known, merged without a session."""

import argparse
from collections.abc import Iterable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib_core.messages import message, plural
from server.console.command import NOT_ACCEPTED, OK, Command
from server.console.output import print_result, remark

if TYPE_CHECKING:
    from calib_core.formats.format import Format
    from calib_core.records import ReadFile, Result, Session

_FIRST_BYTES = 64_000

_NOWHERE = [1.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0]


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE", help="scans: E57, PTX, PLY, PCD, XYZ …")
    parser.add_argument(
        "--poses", type=Path, metavar="FILE", help="a list of poses, one a scan in the files' order"
    )
    units = ("mm", "m", "um", "cm", "in")
    parser.add_argument("--unit", choices=units, help="the files' unit (default: their own, mm)")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="writes scans, result, cloud and mesh here: a session folder"
    )
    edge = "edge of a voxel (default 0.5, or the points' spacing)"
    parser.add_argument("--voxel-mm", type=float, metavar="V", help=edge)
    meshes = ("poisson", "grid", "none")
    parser.add_argument("--mesh", choices=meshes, default="poisson", help="the mesh (default poisson)")
    parser.add_argument("--fill-holes", action="store_true", help="make the mesh watertight")
    thinner = "fewer triangles, none farther off than this"
    parser.add_argument("--mesh-tolerance-mm", type=float, metavar="T", help=thinner)
    parser.add_argument("--reference", type=Path, metavar="FILE", help="the part as it should be: STL, PLY, OBJ")
    methods = ("best-fit", "none")
    parser.add_argument("--align", choices=methods, help="how it is laid into the cloud (default best-fit)")
    parser.add_argument("--tolerance-mm", type=float, metavar="T", help="how far the part may lie off it")
    parser.add_argument("--register", action="store_true", help="move scans by what their overlap says")


def _run(options: argparse.Namespace) -> int:
    """Merge the scans, print how they fit; return 0 where they do, else 1."""
    from calib_core.archive.folder import read_bytes, result_data
    from calib_core.cell.found import ON_FLANGE
    from calib_core.formats.shared.writing import write_pieces
    from calib_core.records import parse_session
    from calib_core.stages.evidence import text_of
    from calib_core.stages.pipeline import run
    from server.console.language import result_as_read, spoken
    from server.console.progress import progress_bar

    files = {f"captures/{k:03d}-{path.name}": path for k, path in enumerate(options.files)}
    captures = list(_captures(files, options.poses, options.unit))
    merge: dict[str, Any] = {"voxel_mm": options.voxel_mm, "mesh": options.mesh, "registration": options.register}
    merge |= {"holes": "fill" if options.fill_holes else None, "mesh_tolerance_mm": options.mesh_tolerance_mm}
    if options.reference is not None:
        name = f"reference{options.reference.suffix.lower()}"
        files[name] = options.reference
        merge |= {"reference": name, "alignment": options.align, "tolerance_mm": options.tolerance_mm}
    cell = {
        "pose_convention": "matrix",
        "known": {ON_FLANGE: [_NOWHERE[4 * k : 4 * k + 4] for k in range(4)]},
        "merge": merge,
    }
    record = {"format": "scancell-session/1", "name": "merge", "cell": cell, "captures": captures}

    def read(name: str) -> bytes:
        return read_bytes(files[name], message("Name the scanner's file."))

    def store(name: str, pieces: Iterable[bytes | memoryview]) -> None:
        if options.out is not None:
            write_pieces(options.out / name, pieces)

    session = parse_session(record, "the scans")
    _tell_doubts(options, session, read)
    with progress_bar(options) as progress:
        result = run(session, read, "merge", progress, store)["merge"]
    if options.out is not None:
        _keep(options.out, session, files, result)
    said = spoken(options)
    text = text_of(result_as_read(result, said), said)
    print_result(options, text, {"session": session.to_json(), "results": {"merge": result_data(result)}})
    if any(finding.remedy is not None for finding in result.findings):
        remark(options, _how_to_apply(options.out))
    return NOT_ACCEPTED if result.verdict == "fail" else OK


def _how_to_apply(out: Path | None) -> str:
    if out is None:
        return message("To repair it give --out DIR, too; then: scancell run DIR --apply 1")
    return message("To repair it: scancell run {folder} --apply 1", folder=str(out))


def _keep(folder: Path, session: "Session", files: dict[str, Path], result: "Result") -> None:
    """Write the scans beside what was made of them, so that report, archive and replay find a whole session."""
    from calib_core.archive.folder import SESSION_FILE, to_json_bytes, write_result
    from calib_core.formats.shared.writing import write_atomically

    for name, path in files.items():
        write_atomically(folder / name, path.read_bytes())
    write_atomically(folder / SESSION_FILE, to_json_bytes(session.to_json()))
    write_result(folder, "merge", result, session)


def _captures(files: dict[str, Path], poses: Path | None, unit: str | None) -> Iterable[dict[str, Any]]:
    """Give a capture a scan, with its pose: that of the list, else that of its file."""
    from calib_core.errors import InputError
    from calib_core.library.machines import read_poses
    from calib_core.robots import parse_pose

    told = None if poses is None else [one for one in read_poses(poses).poses if one.pose is not None]
    scans = [(name, k, own) for name, path in files.items() for k, own in enumerate(_own_poses(path))]
    if told is not None and len(told) != len(scans):
        to_do = message("Give one for each, in their order.")
        need = plural("{count} pose", "{count} poses", by="count", count=len(scans))
        raise InputError(need, f"{len(told)}", to_do, str(poses))
    for number, (name, k, own) in enumerate(scans):
        listed = None if told is None else parse_pose(told[number].convention, told[number].pose or ())
        pose = own if listed is None else listed.matrix.ravel().tolist()
        if pose is None and len(scans) > 1:
            to_do = message("Give --poses FILE, or export the scans as E57 or PTX with their poses.")
            raise InputError("scans with their poses", "none", to_do, str(files[name]))
        settings = ({"scan": k} if _holds_scans(files[name]) else {}) | ({"unit": unit} if unit else {})
        capture = {"id": f"s{number + 1:03d}", "step": "scan", "kind": "cloud", "files": [name]}
        yield capture | ({"format_settings": settings} if settings else {}) | {"pose": pose or _NOWHERE}


def _holds_scans(path: Path) -> bool:
    """Return whether a file's format holds scans with their poses."""
    return _format(path).scan_poses is not None


def _format(path: Path) -> "Format":
    from calib_core.formats.points import recognise

    with path.open("rb") if path.is_file() else nullcontext() as file:
        return recognise(file.read(_FIRST_BYTES) if file else b"", path.name, "cloud")[0]


def _own_poses(path: Path) -> list[list[float] | None]:
    """Return the poses of a file's scans as rows of 4×4 in mm, None where it has none."""
    from calib_core.archive.folder import read_bytes

    poses_of = _format(path).scan_poses
    if poses_of is None:
        return [None]
    return poses_of(read_bytes(path, message("Name the scanner's file.")), str(path))


def _tell_doubts(options: argparse.Namespace, session: "Session", read: "ReadFile") -> None:
    """Say on standard error which files are doubtful, and why."""
    from calib_core.captures.observe import doubts_of

    for capture in session.captures:
        for doubt in doubts_of(capture, read):
            remark(
                options, message("Warning: {file}: {doubt}", file=capture.files[0].partition("-")[2], doubt=doubt)
            )


COMMAND = Command("merge", "merge scans whose poses are known", "files", _arguments, _run)
