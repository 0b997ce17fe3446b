"""`scancell demo`: the whole chain on the simulated cell, each result beside the truth."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from calib_core.frames import RigidTransform
from calib_core.records import TcpResult
from calib_core.session.pipeline import run
from calib_core.simulation import simulate
from server.commands.progress import progress_bar
from server.commands.summary import with_uncertainty

_SIGMAS_OF_95 = 1.96


def demo(seed: int) -> int:
    """Simulate, solve, and print each step's result beside the known truth; return 1 where a verdict is `fail`."""
    simulated = simulate("tcp", seed)
    print(
        f"Simulated cell, seed {seed}: {len(simulated.session.captures)} profiles of a sphere, random robot errors"
    )
    with progress_bar() as progress:
        results = run(simulated.session, simulated.files.__getitem__, "all", progress)
    for result in results.values():
        if isinstance(result, TcpResult):
            print("\n".join(_tcp(result, simulated.truth)), flush=True)
    return 1 if any(result.verdict == "fail" for result in results.values()) else 0


def _tcp(result: TcpResult, truth: dict[str, Any]) -> Iterator[str]:
    found = RigidTransform.from_rounded(result.tool0_from_laser, "tool0", "laser")
    true = RigidTransform.from_rounded(truth["tool0_from_laser"], "tool0", "laser")
    sigmas = np.sqrt(np.diag(np.array(result.covariance)))
    yield f"\ntcp: where the scanner is on the flange — verdict {result.verdict}"
    yield f"  {'':22}{'found ± 95 %':>24}{'truth':>12}{'error':>10}"
    for axis in range(3):
        value = with_uncertainty(found.translation_mm[axis], _SIGMAS_OF_95 * float(sigmas[3 + axis]))
        truly = true.translation_mm[axis]
        yield f"  {'xyz'[axis] + ', mm':22}{value:>24}{truly:12.3f}{found.translation_mm[axis] - truly:10.3f}"
    yield from _rotation(result, found, true, sigmas[:3])
    yield from _center(result, truth)


def _rotation(result: TcpResult, found: RigidTransform, true: RigidTransform, sigmas: Any) -> Iterator[str]:
    sigma_deg = float(np.rad2deg(np.linalg.norm(sigmas)))
    error_deg = float(np.rad2deg(np.linalg.norm(true.difference(found)[:3])))
    yield f"  {'rotation, error':22}{f'{error_deg:.3f}° (expected about {sigma_deg:.3f}°)':>46}"
    if result.two_step.tool0_from_laser is not None:
        two = RigidTransform.from_rounded(result.two_step.tool0_from_laser, "tool0", "laser")
        off = true.difference(two)
        text = f"{np.rad2deg(np.linalg.norm(off[:3])):.3f}° and {np.linalg.norm(off[3:]):.3f} mm"
        yield f"  {'two-step, error':22}{text:>46}"


def _center(result: TcpResult, truth: dict[str, Any]) -> Iterator[str]:
    found, true = np.array(result.sphere_center_in_base_mm), np.array(truth["sphere_center_in_base_mm"])
    yield f"  {'sphere in base, error':22}{f'{np.linalg.norm(found - true):.3f} mm':>46}"
