"""Today's solvers beside the answers of 2026-11: simulated cells, clean and troubled."""

from harness import Row

from tests.oracle.answers import CHANGED, FRAMES, OLDER, answers, kept_answers, largest_difference, scenario_of

SIGMAS = 1e-3


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes all seeds that were kept."""
    kept = kept_answers()
    seeds = list(kept) if full else list(kept)[:6]
    on_purpose = [seed for seed in seeds if seed >= OLDER and scenario_of(seed) in CHANGED]
    largest, worst, others, changed, compared, apart = 0.0, 0, list[str](), 0, 0, 0
    for seed in seeds:
        now = answers(seed)
        changed += now["cell"] != kept[seed]["cell"]
        if seed in on_purpose:
            continue
        compared += sum(stage in FRAMES for stage in now)
        sigmas, differing = largest_difference(kept[seed], now)
        others += [f"seed {seed}: {one}" for one in differing]
        if sigmas > largest:
            largest, worst = sigmas, seed
        apart += sigmas > SIGMAS
    told = f": {'; '.join(others[:3])}" if others else ""
    return [
        Row("cells that are simulated as then", f"{len(seeds)}", f"{len(seeds) - changed}", changed == 0),
        Row(
            f"largest difference in {compared} answers, in stated sigmas",
            f"≤ {SIGMAS:g}",
            f"{largest:.2g} (seed {worst}); {apart} beyond; {len(on_purpose)} cells changed on purpose",
            largest <= SIGMAS,
        ),
        Row("verdicts, warnings and captures that differ", "0", f"{len(others)}{told}", not others),
    ]
