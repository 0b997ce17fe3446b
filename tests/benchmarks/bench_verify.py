"""The verification's decision: false pass at 1.5 × the limit, false fail at half of it, by captures of centres.

Then tools that were brought without an uncertainty, off by 0.3 × and 1.6 × the limit, by profiles on both sides.
"""

import numpy as np
from harness import Row

from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.frames import RigidTransform, rotation_from_vector
from calib_core.robots import parse_pose
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.verify.decision import Estimate, decided, tool_error
from calib_core.stages.verify.held_out import held_out
from calib_core.stages.verify.record import VerifyResult
from calib_core.stages.verify.tool import Tool
from tests.verified import brought_tool

POSITION_MM, TURNING_RAD, _CENTER_MM = 0.05, 2e-4, 0.02
SPHERE = SphereSize(40.0, 0.0)


def run(full: bool) -> list[Row]:
    """Return the figures over 500 cells and 200 brought tools in full, 60 and 20 otherwise."""
    return [*figures(range(500 if full else 60)), *brought(range(200 if full else 20))]


def brought(seeds: range) -> list[Row]:
    """Return how tools are judged that are off by 0.3 and 1.6 mm, with a limit of 1 mm and nothing else told."""
    rows: list[Row] = []
    for off_mm, wrong, decision in ((0.3, "false fail", "fail"), (1.6, "false pass", "pass")):
        ends = [by_a_brought_tool(seed, off_mm) for seed in seeds]
        sides = sum(not right for _, right in ends)
        said = sum(result.decision in (decision, f"conditional-{decision}") for result, _ in ends)
        what = f"{len(ends)} brought tools off by {off_mm:g} × the limit"
        rows.append(Row(f"{what}: cells with a wrong side", "0", str(sides), sides == 0))
        most = 0.01 * len(ends) if decision == "fail" else 0
        rows.append(Row(f"{what}: {wrong}", "≤ 1 %" if decision == "fail" else "0", str(said), said <= most))
        named = sum(any(one.code == "verify-captures-disagree" for one in result.findings) for result, _ in ends)
        rows.append(
            Row(f"{what}: right captures said to disagree", "≤ 1 %", str(named), named <= 0.01 * len(ends))
        )
    return rows


def by_a_brought_tool(seed: int, off_mm: float) -> tuple[VerifyResult, bool]:
    """Return a verification of a tool that was brought, and whether every capture's side is right."""
    cell = brought_tool(seed, off_mm)
    result = solve_stage(cell.session, "verify", cell.files.__getitem__)
    assert isinstance(result, VerifyResult)
    truth = RigidTransform.from_rounded(cell.tool0_from_laser, "tool0", "laser")
    right = True
    for capture, row in zip(cell.session.captures, result.residuals, strict=True):
        assert capture.pose is not None
        base_from_laser = parse_pose("abb", capture.pose) @ truth
        right &= row.side == np.sign(base_from_laser.inverse().apply(cell.sphere_in_base_mm)[1])
    return result, right


def figures(seeds: range) -> list[Row]:
    decisions: dict[float, list[str]] = {1.5: [], 0.5: []}
    errors: list[float] = []
    for seed in seeds:
        limit_mm = 4 * verified(seed, 0.0)[0].uncertainty_mm
        for share, found in decisions.items():
            estimate, off_mm = verified(seed, share * limit_mm)
            found.append(decided(estimate.value_mm, estimate.uncertainty_mm, limit_mm))
            errors.append((estimate.value_mm - off_mm) / (estimate.uncertainty_mm / 2))
    passed = float(np.mean([d == "pass" for d in decisions[1.5]]))
    failed = float(np.mean([d == "fail" for d in decisions[0.5]]))
    middle = float(np.sqrt(np.mean(np.square(errors))))
    count = len(seeds)
    return [
        Row(f"{count} tools off by 1.5 × the limit, U = limit/4: pass", "≤ 1 %", f"{passed:.1%}", passed <= 0.01),
        Row(f"{count} tools off by 0.5 × the limit, U = limit/4: fail", "≤ 5 %", f"{failed:.1%}", failed <= 0.05),
        Row("error of the tool's stated error, in its own sigmas, RMS", "≤ 1.2", f"{middle:.2f}", middle <= 1.2),
    ]  # fmt: skip


def verified(seed: int, off_mm: float) -> tuple[Estimate, float]:
    """Return what a verification of a tool that is off says of it, and by how much it truly is."""
    rng = np.random.default_rng([seed, 26])
    truth, observations = observations_of(rng, 12)
    direction = rng.normal(size=3)
    shift = off_mm * direction / np.linalg.norm(direction)
    given = RigidTransform.of(truth.rotation, truth.translation_mm + shift, "tool0", "laser")
    tool = Tool(given, np.zeros((6, 6)), POSITION_MM, TURNING_RAD)
    found = held_out(observations, SPHERE, tool)
    return tool_error(found.asked, tool), off_mm


def observations_of(
    rng: np.random.Generator, count: int, turned_rad: float = 0.6
) -> tuple[RigidTransform, list[SphereObservation]]:
    """Return a tool, and captures of a still sphere with it."""
    truth = RigidTransform.of(rng.uniform(-1, 1, 3), np.array([35.0, -120.0, 140.0]), "tool0", "laser")
    center = np.array([900.0, 150.0, 420.0])
    return truth, [_observed(k, truth, center, rng, turned_rad) for k in range(count)]


def _observed(
    number: int, truth: RigidTransform, center: np.ndarray, rng: np.random.Generator, turned_rad: float
) -> SphereObservation:
    rotation = rotation_from_vector(rng.uniform(-turned_rad, turned_rad, 3))
    seen = np.array([rng.uniform(-20, 20), rng.uniform(-16, 16), rng.uniform(150, 230)])
    true = RigidTransform.of(rotation, center - rotation @ truth.apply(seen), "base", "tool0")
    recorded = true.perturbed(np.concatenate([rng.normal(0, TURNING_RAD, 3), rng.normal(0, POSITION_MM, 3)]))
    measured = seen + rng.normal(0, _CENTER_MM, 3)
    return SphereObservation(
        f"v{number}", recorded, "center", np.empty((0, 3)), measured, _CENTER_MM**2 * np.eye(3)
    )
