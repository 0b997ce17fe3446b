"""Answers to simulated cells of tcp, turntable and chain, clean and troubled, small enough for thousands.

`answers.json.gz` beside this file has those of commit 82c57c61, before the solvers were rewritten; written by

    git worktree add ../then 82c57c61
    cp tests/oracle/answers.py ../then/tests/
    cd ../then && python tests/answers.py OUT/answers.json.gz SEEDS [PROCESSES]

Answers of the kinds in `CHANGED` differ on purpose since; those of seeds below `OLDER` are of 29 November 2026.

Solving anew must give the same verdict and numbers: `largest_difference` says how they differ, in stated sigmas.
"""

import gzip
import hashlib
import json
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

import calib_core as cc

KEPT = Path(__file__).with_name("answers.json.gz")
SCENARIOS = (
    "tcp", "turntable", "tcp-unknown-sigmas", "turntable-unknown-sigmas", "tcp-spoiled", "turntable-one-height",
    "tcp-moved-sphere", "turntable-wobble", "tcp-wrong-pose", "turntable-encoder-scale", "tcp-mixed",
    "turntable-mixed-mounts", "tcp-stray", "turntable-reversed", "tcp-clipped", "turntable-centers",
    "tcp-rotation-only", "turntable-clouds", "tcp-translation-only", "turntable-on-axis",
)  # fmt: skip
CHANGED = {
    "tcp-translation-only": "refused then, solved as a machine of few axes",
    "tcp-rotation-only": "what is open is said one by one",
    "turntable-wobble": "what repeats widens the ±",
    "turntable-clouds": "a cloud's own noise is no error of its scanner, nor a warning",
}
"""Since the answers were written, and how."""
FIRST_SEED, OLDER = 40_002, 40_018
FRAMES = {
    "tcp": {"tool0_from_laser": "covariance"},
    "turntable": {"base_from_turntable": "covariance"},
    "chain": {"tool0_from_laser": "covariance", "base_from_turntable": "turntable_covariance"},
}
Answers = dict[str, dict[str, Any]]


def scenario_of(seed: int) -> str:
    """Return the cell that a seed stands for: all of them in turn."""
    return SCENARIOS[seed % len(SCENARIOS)]


def answers(seed: int) -> Answers:
    """Return each stage's answer to a seed's cell, with what made it; the error's kind where there is none."""
    simulated, _ = cc.simulate(scenario_of(seed), seed)
    files = hashlib.sha256()
    for capture in simulated.captures:
        for name in capture.files:
            files.update(simulated.read(name))
    found: Answers = {"cell": {"scenario": scenario_of(seed), "files": files.hexdigest()[:16]}}
    try:
        results = simulated.run()
    except cc.CalibrationError as error:
        return found | {"error": {"kind": type(error).__name__}}
    for stage in results:
        if stage in FRAMES:
            found[stage] = _answer(stage, results[stage])
    return found


def _answer(stage: str, result: Any) -> dict[str, Any]:
    told: dict[str, Any] = {
        "verdict": result.verdict,
        "warnings": len(result.warnings),
        "used": "".join("1" if row.used else "0" for row in result.residuals),
    }
    for name, covariance in FRAMES[stage].items():
        told[name] = [float(f"{value:.13g}") for row in getattr(result, name)[:3] for value in row]
        sigmas = np.sqrt(np.diag(getattr(result, covariance)))
        told[f"{name}_sigmas"] = [float(f"{value:.7g}") for value in sigmas]
    return told


def largest_difference(kept: Answers, now: Answers) -> tuple[float, list[str]]:
    """Return by how many stated sigmas two answers to a cell differ at most, and what else differs."""
    others = [name for name in {*kept, *now} if name not in kept or name not in now]
    largest = 0.0
    for stage in [name for name in kept if name in now]:
        for name, value in kept[stage].items():
            if name in ("tool0_from_laser", "base_from_turntable"):
                apart = _sigmas(value, now[stage][name], kept[stage][f"{name}_sigmas"])
                grown = np.abs(np.array(now[stage][f"{name}_sigmas"]) / kept[stage][f"{name}_sigmas"] - 1).max()
                largest = max(largest, apart, float(grown))
            elif not name.endswith("_sigmas") and value != now[stage][name]:
                others.append(f"{stage}: {name} was {value}, is {now[stage][name]}")
    return largest, others


def _sigmas(one: list[float], other: list[float], sigmas: list[float]) -> float:
    first, second = np.array(one).reshape(3, 4), np.array(other).reshape(3, 4)
    turned = first[:, :3].T @ second[:, :3]
    vector = 0.5 * np.array(
        [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
    )
    return float(np.abs(np.concatenate([vector, second[:, 3] - first[:, 3]]) / np.maximum(sigmas, 1e-12)).max())


def kept_answers() -> dict[int, Answers]:
    """Return the answers of before by their seeds."""
    return {int(seed): found for seed, found in json.loads(gzip.decompress(KEPT.read_bytes())).items()}


def write(file: Path, count: int, processes: int) -> None:
    """Write the answers of the solvers that this is run with."""
    seeds = range(FIRST_SEED, FIRST_SEED + count)
    with ProcessPoolExecutor(processes) as pool:
        found = dict(zip(map(str, seeds), pool.map(answers, seeds, chunksize=5), strict=True))
    file.write_bytes(gzip.compress(json.dumps(found, separators=(",", ":")).encode(), 9, mtime=0))


if __name__ == "__main__":
    write(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 1)
