"""`scancell merge`: scans whose poses are known, merged without a session."""

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from calib_core.messages import message, plural
from server.console.command import NOT_ACCEPTED, OK, Command
from server.console.output import print_result

_NOWHERE = [1.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0]


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE", help="scans: E57, PLY, PCD, XYZ …")
    parser.add_argument(
        "--poses",
        type=Path,
        metavar="FILE",
        help="a list of poses, one a scan in the files' order",
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="writes result, cloud and mesh here")
    parser.add_argument("--voxel-mm", type=float, default=0.5, metavar="V", help="edge of a voxel (default 0.5)")
    meshes = ("poisson", "grid", "none")
    parser.add_argument("--mesh", choices=meshes, default="poisson", help="the mesh (default poisson)")
    parser.add_argument("--register", action="store_true", help="move scans by what their overlap says")


def _run(options: argparse.Namespace) -> int:
    """Merge the scans, print how they fit; return 0 where they do, else 1."""
    from calib_core.archive.folder import read_bytes, result_data
    from calib_core.formats.shared.writing import write_pieces
    from calib_core.records import parse_session
    from calib_core.stages.pipeline import run
    from server.console.progress import progress_bar

    files = {f"captures/{k:03d}-{path.name}": path for k, path in enumerate(options.files)}
    captures = list(_captures(files, options.poses))
    cell = {
        "pose_convention": "matrix",
        "known": {"tool0_from_laser": [_NOWHERE[4 * k : 4 * k + 4] for k in range(4)]},
        "merge": {"voxel_mm": options.voxel_mm, "mesh": options.mesh, "registration": options.register},
    }
    record = {"format": "scancell-session/1", "name": "merge", "cell": cell, "captures": captures}

    def read(name: str) -> bytes:
        return read_bytes(files[name], message("Name the scanner's file."))

    def store(name: str, pieces: Iterable[bytes | memoryview]) -> None:
        if options.out is not None:
            write_pieces(options.out / name, pieces)

    session = parse_session(record, "the scans")
    with progress_bar(options) as progress:
        result = run(session, read, "merge", progress, store)["merge"]
    if options.out is not None:
        written = result.model_dump_json(indent=2).encode()
        write_pieces(options.out / "results" / "merge.json", iter([written]))
    print_result(options, str(result), {"session": session.to_json(), "results": {"merge": result_data(result)}})
    return NOT_ACCEPTED if result.verdict == "fail" else OK


def _captures(files: dict[str, Path], poses: Path | None) -> Iterable[dict[str, Any]]:
    """Give a capture a scan, with its pose: that of the list, else that of its file."""
    from calib_core.errors import InputError
    from calib_core.library.machines import read_poses
    from calib_core.robots import parse_pose

    told = None if poses is None else [one for one in read_poses(poses).poses if one.pose is not None]
    scans = [(name, k, own) for name, path in files.items() for k, own in enumerate(_own_poses(path))]
    if told is not None and len(told) != len(scans):
        to_do = message("Give one pose a scan, in the files' order.")
        raise InputError(
            plural("{count} pose", "{count} poses", by="count", count=len(scans)),
            f"{len(told)}",
            to_do,
            str(poses),
        )
    for number, (name, k, own) in enumerate(scans):
        listed = None if told is None else parse_pose(told[number].convention, told[number].pose or ())
        pose = own if listed is None else listed.matrix.ravel().tolist()
        if pose is None and len(scans) > 1:
            to_do = message("Give --poses FILE, or export the scans as E57 with their poses.")
            raise InputError("scans with their poses", "a file without one", to_do, str(files[name]))
        settings = {"format_settings": {"scan": k}} if name.endswith(".e57") else {}
        capture = {"id": f"s{number + 1:03d}", "step": "scan", "kind": "cloud", "files": [name]}
        yield capture | settings | {"pose": pose or _NOWHERE}


def _own_poses(path: Path) -> list[list[float] | None]:
    """Return the poses of a file's scans as rows of 4×4 in mm, None where it has none."""
    from calib_core.archive.folder import read_bytes
    from calib_core.formats.e57 import scan_poses

    if path.suffix.lower() != ".e57":
        return [None]
    return scan_poses(read_bytes(path, message("Name the scanner's file.")), str(path))


COMMAND = Command("merge", "merge scans whose poses are known", "files", _arguments, _run)
