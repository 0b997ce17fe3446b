"""`scancell poses`: what stands in a controller's file."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from server.console.command import OK, Command
from server.console.output import print_result

if TYPE_CHECKING:
    from calib_core.robots.controller_file import ControllerFile, FilePose, Frame, Skipped


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "files", type=Path, nargs="+", metavar="FILE", help="a program, data list, folder or zip of a backup"
    )
    brand = "the controller's brand, where the files do not tell it"
    parser.add_argument("--brand", metavar="NAME", help=brand)
    as_written = "take poses as they stand, where the tool or frame they were taught with is not in the files"
    told = (
        "what the files do not say: convention, unit, columns of a table, topic, base, flange of a recording, arm"
    )
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help=told)
    corrected = "correct the poses (or joints: columns j1_deg …) by the arm's errors that this session applies"
    parser.add_argument("--corrected", type=Path, metavar="SESSION", help=corrected)
    parser.add_argument("--as-written", action="store_true", help=as_written)


def _run(options: argparse.Namespace) -> int:
    """Print poses, tools and frames of a controller's files, and what was skipped."""
    from calib_core.library.machines import read_poses

    told = pairs_of(options.set)
    if options.corrected is not None:
        return _corrected(options, told)
    read = read_poses(*options.files, brand=options.brand, as_written=options.as_written, told=told)
    print_result(options, _text(read), read.to_json())
    return OK


def _corrected(options: argparse.Namespace, told: dict[str, str]) -> int:
    """Print the poses of files as they truly are, by what a session found of its arm."""
    import calib_core as cc
    from calib_core.library.corrected_poses import corrected_poses
    from calib_core.messages import message

    opened = cc.load(options.corrected)
    found = [corrected_poses(opened, path, options.brand, told) for path in options.files]
    poses = [one.to_json() for each in found for one in each.poses]
    skipped = [one for each in found for one in each.skipped]
    without, with_it = held_out = found[0].held_out_rms_mm
    left_out = (
        "the ball at poses left out lay {with_mm:.3f} mm off (RMS), {without_mm:.3f} mm without the correction"
    )
    lines = [
        message(
            "{count} poses corrected ({convention})", count=len(poses), convention=opened.cell.pose_convention
        ),
        "  " + message(left_out, with_mm=with_it, without_mm=without),
        *map(_corrected_line, poses),
        *("  " + message("skipped: line {line}: {why}", line=one["line"], why=one["reason"]) for one in skipped),
    ]
    data = {"brand": None, "poses": poses, "tools": [], "frames": [], "skipped": skipped}
    print_result(options, "\n".join(lines), {**data, "held_out_rms_mm": held_out})
    return OK


def _corrected_line(pose: dict[str, Any]) -> str:
    from calib_core.messages import explained, message

    numbers = " ".join(f"{value:.6g}" for value in pose["pose"])
    beyond = pose["beyond_captures_deg"]
    parts = [explained(pose["name"], numbers), message("moved by {moved_mm:.3f} mm", moved_mm=pose["moved_mm"])]
    if beyond >= 1:
        parts.append(message("a joint lies {beyond_deg:.0f}° beyond the captures", beyond_deg=beyond))
    return "  " + message("{parts:,}", parts=parts)


def pairs_of(words: list[str]) -> dict[str, str]:
    """Return what ``NAME=VALUE`` options say; raises InputError."""
    from calib_core.errors import InputError

    pairs: dict[str, str] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals:
            raise InputError("NAME=VALUE", f"'{word}'", "Say it as NAME=VALUE.", "--set")
        pairs[name.strip()] = value
    return pairs


def _text(read: "ControllerFile") -> str:
    from calib_core import counted
    from calib_core.messages import message
    from calib_core.proof import WORDS
    from calib_core.robots import CONVENTIONS

    count = {
        "poses": counted.poses(len(read.poses)),
        "tools": counted.tools(len(read.tools)),
        "frames": counted.frames(len(read.frames)),
    }
    lines = [message("{brand}: {poses}, {tools}, {frames}.", brand=read.brand, **count)]
    lines += [message("Its reader is {proof}.", proof=WORDS[read.proof])]
    if read.poses:
        names = CONVENTIONS[read.poses[0].convention].numbers
        units = CONVENTIONS[read.poses[0].convention].units
        lines += ["", message("Poses of the flange in the base ({names}; {units})", names=names, units=units)]
        lines += [_pose(pose) for pose in read.poses]
    for title, frames in ((message("Tools"), read.tools), (message("Coordinate frames"), read.frames)):
        if frames:
            lines += ["", title, *map(_frame, frames)]
    doubts = dict.fromkeys(pose.doubt for pose in read.poses if pose.doubt)
    if doubts or read.notes:
        lines += ["", message("To make sure of"), *(f"  {text}" for text in (*doubts, *read.notes))]
    if read.skipped:
        lines += ["", message("Skipped"), *map(_skipped, read.skipped)]
    return "\n".join(lines)


def _skipped(row: "Skipped") -> str:
    from calib_core.messages import explained

    return "  " + explained(f"{row.file}:{row.line}", row.reason)


def _pose(pose: "FilePose") -> str:
    from calib_core.messages import explained, message

    numbers = " ".join(f"{v:g}" if v == 0 else f"{v:.6g}" for v in pose.pose or ())
    parts: list[str] = [explained(pose.name, numbers or message("joints alone"))]
    if pose.tool is not None or pose.frame is not None:
        tool, frame = _or_dash(pose.tool), _or_dash(pose.frame)
        parts.append(message("taught with tool {tool}, frame {frame}", tool=tool, frame=frame))
    if pose.external:
        parts.append(", ".join(f"{axis} {value:g}" for axis, value in pose.external.items()))
    return "  " + message("{parts:,}", parts=[*parts, f"{pose.file}:{pose.line}"])


def _frame(frame: "Frame") -> str:
    name = f" {frame.name}" if frame.name and frame.name != frame.number else ""
    moving = f"; {frame.moving}" if frame.moving else ""
    numbers = " ".join(f"{v:.6g}" for v in frame.pose)
    return f"  {frame.number}{name}: {numbers}{moving}; {frame.file}:{frame.line}"


def _or_dash(value: object) -> str:
    return "–" if value is None else str(value)


COMMAND = Command(
    "poses", "read poses, tools and frames from a robot controller's files", "files", _arguments, _run
)
