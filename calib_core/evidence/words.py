"""Names of captures in sentences: one cause, one sentence."""

from collections.abc import Mapping, Sequence
from typing import Final

from calib_core.messages import Message, Names

_SHORTEST_RUN: Final = 3


def captures_text(names: Sequence[str], order: Sequence[str] = ()) -> Message:
    """Return captures as a sentence names them in each language: ``p03, p07 and p09``, or ``f13–f24`` for a run.

    Parameters
    ----------
    names : sequence of str
    order : sequence of str
        All captures as they follow each other; three or more neighbours in it are a run.
    """
    place = {name: k for k, name in enumerate(order)}
    runs: list[list[str]] = []
    for name in sorted(names, key=lambda one: place.get(one, len(place))):
        if runs and name in place and place.get(runs[-1][-1]) == place[name] - 1:
            runs[-1].append(name)
        else:
            runs.append([name])
    parts = [part for run in runs for part in ([f"{run[0]}–{run[-1]}"] if len(run) >= _SHORTEST_RUN else run)]
    return Message("{captures}", {"captures": Names(parts)})


def by_cause(causes: Mapping[str, str]) -> dict[str, list[str]]:
    """Return the captures of each cause, the cause of most captures first; `causes` is by capture."""
    found: dict[str, list[str]] = {}
    for capture, cause in causes.items():
        found.setdefault(cause, []).append(capture)
    return dict(sorted(found.items(), key=lambda item: -len(item[1])))
