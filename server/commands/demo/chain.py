"""`scancell demo`: the whole chain on the simulated cell, each result beside the truth."""

import argparse
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from calib_core.archive.folder import result_data
from calib_core.cell.found import scanner_frame
from calib_core.evidence.numbers import quantity, quantity_text
from calib_core.evidence.text import plain
from calib_core.frames import RigidTransform
from calib_core.records import Result
from calib_core.simulation import simulate
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.merge.record import MergeResult
from calib_core.stages.pipeline import run
from calib_core.stages.tcp.record import TcpResult
from calib_core.stages.turntable.record import TurntableResult
from server.console.command import NOT_ACCEPTED, OK
from server.console.output import print_result, remark
from server.console.progress import progress_bar
from server.jobs.kernels import OF_SCANS, compiling_beside


def demo(options: argparse.Namespace) -> int:
    """Simulate, solve, and print each step's result beside the known truth; return 1 where a verdict is `fail`.

    The session is kept in the workbench's store, with all its results; with --no-serve nowhere.
    """
    simulated = simulate("cell", options.seed)
    steps = Counter(capture.step for capture in simulated.session.captures)
    intro = (
        f"Simulated cell, seed {options.seed}: {steps['tcp']} captures of a still sphere, {steps['turntable']} of "
        f"one on the turntable, {steps['scan']} scans of a part; random errors"
    )
    made: dict[str, bytes] = {}

    def store(name: str, pieces: Iterable[bytes | memoryview]) -> None:
        made[name] = b"".join(pieces)

    # What merging needs is compiled while the steps before it run.
    with progress_bar(options) as progress, compiling_beside(OF_SCANS):
        results = run(simulated.session, simulated.files.__getitem__, "all", progress, store)
    lines = [line for result in results.values() for line in _lines(result, results, simulated.truth, made)]
    data = {"truth": simulated.truth, "results": {name: result_data(result) for name, result in results.items()}}
    print_result(options, "\n".join([intro, *lines]), data)
    if not options.no_serve:
        from server.commands.demo.session import keep_session

        name = keep_session(simulated, results, made, options.data)
        remark(options, f"the workbench has it as the session '{name}'")
    return NOT_ACCEPTED if any(result.verdict == "fail" for result in results.values()) else OK


def _lines(
    result: Result, results: Mapping[str, Result], truth: dict[str, Any], made: Mapping[str, bytes]
) -> Iterator[str]:
    match result:
        case TcpResult():
            yield from _tcp(result, truth)
        case TurntableResult() | ChainResult():
            yield from _table(result, truth)
        case MergeResult():
            from server.commands.demo.merge import merge_lines

            chain = results["chain"]
            assert isinstance(chain, ChainResult)
            yield from merge_lines(result, chain, truth, made)
        case _:
            yield f"\n{result.method} — verdict {result.verdict}"


def _table(result: TurntableResult | ChainResult, truth: dict[str, Any]) -> Iterator[str]:
    what = (
        "where the table's axis is" if result.stage == "turntable" else "tool and table from all captures together"
    )
    yield f"\n{result.stage}: {what} — verdict {result.verdict}"
    yield f"  {'':22}{'found ± 95 %':>24}{'truth':>12}{'error':>10}"
    sigmas = np.sqrt(np.diag(np.array(result.axis_point_covariance)))
    found, true = result.axis_point_in_base_mm, truth["axis_point_in_base_mm"]
    for axis in range(3):
        value = _measured(found[axis], float(sigmas[axis]))
        label = f"axis, point {'xyz'[axis]}, mm"
        yield f"  {label:22}{value:>24}{true[axis]:12.3f}{found[axis] - true[axis]:10.3f}"
    sigma_deg = result.axis_direction_sigma_deg
    error_deg = _angle_deg(result.axis_direction_in_base, truth["axis_direction_in_base"])
    yield f"  {'axis, direction error':22}{f'{error_deg:.4f}° (expected about {sigma_deg:.4f}°)':>46}"
    if result.circles_axis_direction_in_base is not None:
        error_deg = _angle_deg(result.circles_axis_direction_in_base, truth["axis_direction_in_base"])
        yield f"  {'paper, direction error':22}{f'{error_deg:.4f}°':>46}"
    if isinstance(result, ChainResult):
        tool = result.mount_from_laser
        off = tool.difference(scanner_frame(truth))
        text = f"{np.rad2deg(np.linalg.norm(off[:3])):.3f}° and {np.linalg.norm(off[3:]):.3f} mm"
        yield f"  {'tool, error':22}{text:>46}"


def _measured(value: float, sigma: float) -> str:
    return plain(quantity_text(quantity(value, "", sigma)))


def _angle_deg(one: list[float], other: list[float]) -> float:
    return float(np.rad2deg(np.linalg.norm(np.cross(one, other))))


def _tcp(result: TcpResult, truth: dict[str, Any]) -> Iterator[str]:
    found = result.mount_from_laser
    true = scanner_frame(truth)
    sigmas = np.sqrt(np.diag(np.array(result.covariance)))
    yield f"\ntcp: where the scanner is on the flange — verdict {result.verdict}"
    yield f"  {'':22}{'found ± 95 %':>24}{'truth':>12}{'error':>10}"
    for axis in range(3):
        value = _measured(found.translation_mm[axis], float(sigmas[3 + axis]))
        truly = true.translation_mm[axis]
        yield f"  {'xyz'[axis] + ', mm':22}{value:>24}{truly:12.3f}{found.translation_mm[axis] - truly:10.3f}"
    yield from _rotation(result, found, true, sigmas[:3])
    yield from _center(result, truth)


def _rotation(result: TcpResult, found: RigidTransform, true: RigidTransform, sigmas: Any) -> Iterator[str]:
    sigma_deg = float(np.rad2deg(np.linalg.norm(sigmas)))
    error_deg = float(np.rad2deg(np.linalg.norm(true.difference(found)[:3])))
    yield f"  {'rotation, error':22}{f'{error_deg:.3f}° (expected about {sigma_deg:.3f}°)':>46}"
    if (two := result.two_step.placed_scanner) is not None:
        off = true.difference(two)
        text = f"{np.rad2deg(np.linalg.norm(off[:3])):.3f}° and {np.linalg.norm(off[3:]):.3f} mm"
        yield f"  {'two-step, error':22}{text:>46}"


def _center(result: TcpResult, truth: dict[str, Any]) -> Iterator[str]:
    found, true = np.array(result.sphere_center_in_base_mm), np.array(truth["sphere_center_in_base_mm"])
    yield f"  {'sphere in base, error':22}{f'{np.linalg.norm(found - true):.3f} mm':>46}"
