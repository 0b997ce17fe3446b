"""`scancell demo`: the whole chain on the simulated cell, each result beside the truth."""

import argparse
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from calib_core.archive.folder import result_data
from calib_core.cell.found import scanner_frame
from calib_core.evidence.numbers import quantity, quantity_text
from calib_core.evidence.text import plain
from calib_core.frames import RigidTransform
from calib_core.messages import Message, message
from calib_core.records import Result
from calib_core.simulation import simulate
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.merge.record import MergeResult
from calib_core.stages.pipeline import run
from calib_core.stages.tcp.record import TcpResult
from calib_core.stages.turntable.record import TurntableResult
from server.commands.demo.sheet import Sheet
from server.console.command import NOT_ACCEPTED, OK
from server.console.language import spoken
from server.console.output import print_result, remark
from server.console.progress import progress_bar
from server.jobs.kernels import OF_SCANS, compiling_beside


def demo(options: argparse.Namespace) -> int:
    """Simulate, solve, and print each step's result beside the known truth; return 1 where a verdict is `fail`.

    The session is kept in the workbench's store, with all its results; with --no-serve nowhere.
    """
    simulated = simulate("cell", options.seed)
    steps = Counter(capture.step for capture in simulated.session.captures)
    intro = message(
        "Simulated cell, seed {seed}: {still} captures of a still sphere, {turned} of one on the turntable, "
        "{scans} scans of a part; random errors",
        seed=options.seed,
        still=steps["tcp"],
        turned=steps["turntable"],
        scans=steps["scan"],
    )
    made: dict[str, bytes] = {}

    def store(name: str, pieces: Iterable[bytes | memoryview]) -> None:
        made[name] = b"".join(pieces)

    # What merging needs is compiled while the steps before it run.
    with progress_bar(options) as progress, compiling_beside(OF_SCANS):
        results = run(simulated.session, simulated.files.__getitem__, "all", progress, store)
    sheet = Sheet(spoken(options))
    for result in results.values():
        _add(sheet, result, results, simulated.truth, made)
    data = {"truth": simulated.truth, "results": {name: result_data(result) for name, result in results.items()}}
    print_result(options, "\n".join([intro, *sheet.lines]), data)
    if not options.no_serve:
        from server.commands.demo.session import keep_session

        name = keep_session(simulated, results, made, options.data)
        remark(options, message("the workbench has it as the session '{name}'", name=name))
    return NOT_ACCEPTED if any(result.verdict == "fail" for result in results.values()) else OK


def _add(
    sheet: Sheet, result: Result, results: Mapping[str, Result], truth: dict[str, Any], made: Mapping[str, bytes]
) -> None:
    match result:
        case TcpResult():
            _tcp(sheet, result, truth)
        case TurntableResult() | ChainResult():
            _table(sheet, result, truth)
        case MergeResult():
            from server.commands.demo.merge import add_merge

            chain = results["chain"]
            assert isinstance(chain, ChainResult)
            add_merge(sheet, result, chain, truth, made)
        case _:
            sheet.title(result.method, result.verdict, "")


def _table(sheet: Sheet, result: TurntableResult | ChainResult, truth: dict[str, Any]) -> None:
    only_table = result.stage == "turntable"
    sheet.title(
        result.stage,
        result.verdict,
        message("where the table's axis is" if only_table else "tool and table from all captures together"),
    )
    sheet.heads(message("found ± 95 %"))
    sigmas = np.sqrt(np.diag(np.array(result.axis_point_covariance)))
    found, true = result.axis_point_in_base_mm, truth["axis_point_in_base_mm"]
    for axis in range(3):
        label = message("axis, point {axis}, mm", axis="xyz"[axis])
        sheet.numbers(label, _measured(found[axis], float(sigmas[axis])), found[axis], true[axis])
    error_deg = _angle_deg(result.axis_direction_in_base, truth["axis_direction_in_base"])
    sheet.line(
        message("axis, direction error"), _expected(f"{error_deg:.4f}°", f"{result.axis_direction_sigma_deg:.4f}°")
    )
    if result.circles_axis_direction_in_base is not None:
        error_deg = _angle_deg(result.circles_axis_direction_in_base, truth["axis_direction_in_base"])
        sheet.line(message("paper, direction error"), f"{error_deg:.4f}°")
    if isinstance(result, ChainResult):
        sheet.line(message("tool, error"), _off(result.mount_from_laser, truth))


def _measured(value: float, sigma: float) -> str:
    return plain(quantity_text(quantity(value, "", sigma)))


def _expected(found: str, expected: str) -> Message:
    return message("{found} (expected about {expected})", found=found, expected=expected)


def _off(tool: RigidTransform, truth: dict[str, Any]) -> Message:
    off = tool.difference(scanner_frame(truth))
    turned, moved = (float(np.linalg.norm(part)) for part in (off[:3], off[3:]))
    return message("{turned_deg:.3f}° and {moved_mm:.3f} mm", turned_deg=np.rad2deg(turned), moved_mm=moved)


def _angle_deg(one: list[float], other: list[float]) -> float:
    return float(np.rad2deg(np.linalg.norm(np.cross(one, other))))


def _tcp(sheet: Sheet, result: TcpResult, truth: dict[str, Any]) -> None:
    found, true = result.mount_from_laser, scanner_frame(truth)
    sigmas = np.sqrt(np.diag(np.array(result.covariance)))
    sheet.title(result.stage, result.verdict, message("where the scanner is on the flange"))
    sheet.heads(message("found ± 95 %"))
    for axis in range(3):
        value = found.translation_mm[axis]
        sheet.numbers(
            "xyz"[axis] + ", mm", _measured(value, float(sigmas[3 + axis])), value, true.translation_mm[axis]
        )
    sigma_deg = float(np.rad2deg(np.linalg.norm(sigmas[:3])))
    error_deg = float(np.rad2deg(np.linalg.norm(true.difference(found)[:3])))
    sheet.line(message("rotation, error"), _expected(f"{error_deg:.3f}°", f"{sigma_deg:.3f}°"))
    if (two := result.two_step.placed_scanner) is not None:
        sheet.line(message("two-step, error"), _off(two, truth))
    center, truly = np.array(result.sphere_center_in_base_mm), np.array(truth["sphere_center_in_base_mm"])
    sheet.line(message("sphere in base, error"), f"{np.linalg.norm(center - truly):.3f} mm")
