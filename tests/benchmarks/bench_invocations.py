"""500 odd invocations of the command line: the right status, one sentence, nothing overwritten."""

import sys

from harness import Row
from odd_invocations import invocations


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` goes through all of them in three orders."""
    outcomes = [odd for seed in ((1, 2, 3) if full else (1,)) for odd in invocations(seed, 10_000)]
    wrong = [odd for odd in outcomes if odd.wrong]
    for odd in wrong[:40]:
        print(f"{odd.wrong}: {[word[:60] for word in odd.words]}: {odd.said[-300:]!r}", file=sys.stderr)
    what = f"{len(outcomes)} odd invocations: status, one sentence, nothing overwritten"
    return [Row(what, "0 wrong of ≥ 500", f"{len(wrong)} wrong", not wrong and len(outcomes) >= 500)]
