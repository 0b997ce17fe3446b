"""The figures of docs/figures.md: kept as JSON, one row a line, and made a page by `scancell bench --write`."""

import json
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
ROWS = Path(__file__).with_name("figures.json")
PAGE = ROOT / "docs" / "figures.md"
MOST_WORDS = 25

_HEAD = """# Figures

Made from `tests/benchmarks/figures.json` by `scancell bench NAME --write`, which measures a benchmark and
replaces its rows; not to be edited. Two cores, other work beside: times are pessimistic, ratios are medians of
interleaved runs in one process.
"""

Figure = dict[str, str]
"""`section`, `what`, `target`, `measured`, `date`, `command`; `missed` is why, where a target is not met."""


def read() -> list[Figure]:
    """Return the figures in the order of the page."""
    return json.loads(ROWS.read_text(encoding="utf-8"))


def write(figures: Iterable[Figure]) -> None:
    """Keep figures, and write the page."""
    figures = list(figures)
    lines = ",\n".join(json.dumps(one, ensure_ascii=False) for one in figures)
    ROWS.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    PAGE.write_text(page(figures), encoding="utf-8")


def measured_anew(figures: list[Figure], name: str, rows: Iterable[Mapping[str, Any]], full: bool) -> list[Figure]:
    """Return the figures with those of a benchmark's rows replaced or added; a row is known by what it says."""
    command = f"scancell bench {name}{' --full' if full else ''}"
    found = list(figures)
    for row in rows:
        figure = {key: str(row[key]).strip() for key in ("what", "target", "measured")}
        figure |= {"date": datetime.now(UTC).date().isoformat(), "command": command}
        if row["holds"] is False:
            figure["missed"] = "not explained yet"
        places = [k for k, one in enumerate(found) if one["what"] == figure["what"] and name in one["command"]]
        near = [k for k, one in enumerate(found) if one["command"].startswith(f"scancell bench {name}")]
        if places:
            before = found[places[0]]
            if "missed" in figure and "missed" in before:
                figure["missed"] = before["missed"]
            found[places[0]] = {"section": before["section"], **figure}
        elif near:
            found.insert(near[-1] + 1, {"section": found[near[-1]]["section"], **figure})
        else:
            found.append({"section": name.replace("_", " ").capitalize(), **figure})
    return found


def page(figures: Iterable[Figure]) -> str:
    """Return the page: those that miss their target first, then all by section."""
    figures = list(figures)
    missed = [one for one in figures if "missed" in one]
    text = f"{_HEAD}\n{len(missed)} of {len(figures)} figures miss their target:\n\n"
    for one in missed:
        text += f"- {one['what']}: {one['measured']}, {one['target']}. {one['missed'].rstrip('.')}.\n"
    for section in dict.fromkeys(one["section"] for one in figures):
        text += f"\n## {section}\n\n| what | target | measured | date | command |\n|---|---|---|---|---|\n"
        for one in figures:
            if one["section"] == section:
                cells = (one["what"], one["target"] or "–", one["measured"], one["date"], f"`{one['command']}`")
                text += f"| {' | '.join(cells)} |\n"
    return text
