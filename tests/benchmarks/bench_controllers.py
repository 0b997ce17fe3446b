"""Controllers' files, mutated: right poses, or a sentence with the line; none silently wrong, no crash."""

import random
from collections.abc import Iterator

from controller_mutations import BRANDS, judged, mutated
from harness import Row


def run(full: bool) -> Iterator[Row]:
    """Yield a row a brand: 10,000 mutations with --full."""
    count = 10_000 if full else 500
    for brand in BRANDS:
        wrong = [found for seed in range(count) if (found := judged(brand, mutated(brand, random.Random(seed))))]
        what = f"{brand}: {count} mutated files, silently wrong or lost"
        yield Row(what, "0", f"{len(wrong)}{f' ({wrong[0][:60]})' if wrong else ''}", not wrong)
