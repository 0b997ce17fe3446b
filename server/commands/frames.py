"""`scancell frames`: the transforms of a cell, and any that follows from them."""

import argparse
from typing import TYPE_CHECKING

from server.console.command import OK, Command, session_argument
from server.console.output import print_result

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from calib_core.review.cell_frames import ListedAxis, ListedFrame, SessionFrames


def _arguments(parser: argparse.ArgumentParser) -> None:
    session_argument(parser)
    parser.add_argument("into", nargs="?", help="a frame: base, tool0, laser, camera, board, turntable")
    parser.add_argument("outof", nargs="?", help="the frame whose points are mapped into the first one")
    parser.add_argument("--capture", metavar="ID", help="the capture whose robot pose counts")


def _run(options: argparse.Namespace) -> int:
    """Print the cell's transforms, and the one asked for."""
    from calib_core.archive.archive import opened
    from calib_core.archive.folder import load_session
    from calib_core.archive.stored_results import stored_results
    from calib_core.errors import InputError
    from calib_core.graph.keys import Graph
    from calib_core.review.cell_frames import session_frames

    if options.into is not None and options.outof is None:
        to_do = "Name both, or neither."
        raise InputError("two frames, INTO and OUTOF", "'{into}' alone", to_do, "OUTOF", into=options.into)
    asked = None if options.into is None else (options.into, options.outof)
    with opened(options.session) as folder:
        session, read = load_session(folder)
        results = stored_results(folder)
        stale = Graph.stale_of(session, read, results)
        frames = session_frames(session, results, stale, asked, options.capture)
    print_result(options, _text(frames, results), frames.to_json())
    return OK


def _text(frames: "SessionFrames", solved: "Collection[str]") -> str:
    from calib_core.messages import message

    if frames.asked is None:
        return "\n".join(
            [*(_edge(edge, edge.source in solved) for edge in frames.edges), *map(_axis, frames.axes)]
        )
    asked = frames.asked
    name, through = asked.name, " · ".join(asked.through)
    lines: list[str] = [message("{name}, through {through}", name=name, through=through) if through else name]
    lines += ["  " + " ".join(f"{number:12.6f}" for number in row) for row in asked.matrix]
    lines += _uncertainty(asked.covariance)
    if asked.without_covariance:
        untold = message(
            "Without the uncertainty of {names:,}, which nobody stated.", names=asked.without_covariance
        )
        lines.append("  " + untold)
    if asked.stale:
        lines.append("  " + message("Out of date: inputs have changed since it was solved."))
    return "\n".join(lines)


def _edge(edge: "ListedFrame", solved: bool) -> str:
    """Return where a transform of the cell comes from; what its stage has `solved`, and has not, stays open."""
    from calib_core.messages import message

    name = message("{name} of {scanner}", name=edge.name, scanner=edge.scanner) if edge.scanner else edge.name
    match edge.state:
        case "measured":
            told = message("{name}: measured with each capture", name=name)
            if edge.source != "captures":
                told = message("{name}: measured, capture {capture}", name=name, capture=edge.source)
        case "known":
            told = message("{name}: known, {source}", name=name, source=edge.source)
        case "solved":
            told = message("{name}: solved by {stage}", name=name, stage=edge.source)
            told = _known(told, _worst(edge.covariance, 3), _worst(edge.covariance, 0))
        case "sought" if solved:
            told = message("{name}: left open by the motions in {stage}", name=name, stage=edge.source)
        case "sought":
            told = message("{name}: not solved yet, {stage} will", name=name, stage=edge.source)
    return message("{said}; out of date: its inputs have changed since", said=told) if edge.stale else told


def _axis(axis: "ListedAxis") -> str:
    """Return an axis's line: what it moves, where it lies in base as all axes read zero, and its ±."""
    from math import isfinite

    from calib_core.messages import message

    carries = message("moves the robot") if axis.carries == "robot" else message("moves the part")
    kind = message("rotary axis") if axis.kind == "rotary" else message("linear axis")
    name = message("{name} ({told:,})", name=axis.name, told=[kind, carries])
    if axis.found is None:
        told = message("{name}: not solved yet, {stage} will", name=name, stage=axis.source)
    else:
        way = " ".join(f"{value:.4f}" for value in axis.found.axis_direction)
        told = message("{name}: solved by {stage}, along {way} in base", name=name, stage=axis.source, way=way)
        known = [f"{value:.2f}" for value in axis.found.axis_point_mm or () if isfinite(value)]
        if point := " ".join(known):
            told = message("{said}, through {point}", said=told, point=point)
        told = _known(told, _worst(axis.found.covariance, 3), _worst(axis.found.covariance, 0))
    return message("{said}; out of date: its inputs have changed since", said=told) if axis.stale else told


def _known(said: str, sigma_mm: float | None, sigma_rad: float | None) -> str:
    """Return what is said with its ± (k = 2) in the worst direction, where it is stated."""
    from math import degrees

    from calib_core.evidence.numbers import plus_minus, quantity_text
    from calib_core.evidence.text import plain
    from calib_core.messages import message

    told = [quantity_text(plus_minus(sigma_mm, "mm"))] if sigma_mm else []
    told += [quantity_text(plus_minus(degrees(sigma_rad), "°"))] if sigma_rad else []
    return message("{said}, {known:,}", said=said, known=[plain(one) for one in told]) if told else said


def _worst(covariance: "Sequence[Sequence[float]] | None", first: int) -> float | None:
    """Return the standard deviation in the worst direction of three members of a covariance (6, 6)."""
    import numpy as np

    if covariance is None:
        return None
    own = np.array(covariance, dtype=float)[first : first + 3, first : first + 3]
    return float(np.sqrt(max(np.linalg.eigvalsh(own)[-1], 0.0))) if np.isfinite(own).all() else None


def _uncertainty(covariance: "Sequence[Sequence[float]]") -> list[str]:
    """Return the expanded uncertainty (k = 2) of rx ry rz tx ty tz, as results state it."""
    from math import degrees

    from calib_core.evidence.numbers import plus_minus, quantity_text
    from calib_core.evidence.text import plain

    sigmas = [covariance[k][k] ** 0.5 for k in range(6)]
    turned = (quantity_text(plus_minus(degrees(sigma), "°")) for sigma in sigmas[:3])
    shifted = (quantity_text(plus_minus(sigma, "mm")) for sigma in sigmas[3:])
    named = zip(("rx", "ry", "rz", "tx", "ty", "tz"), (*turned, *shifted), strict=True)
    return [plain("  " + ", ".join(f"{name} {text}" for name, text in named))]


COMMAND = Command(
    "frames", "print the cell's transforms, or any that follows from them", "session", _arguments, _run
)
