"""Ten reports on paper, in three languages, A4 and letter: nothing cut, no head alone, no control."""

import html
import os
import re
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from harness import Row, kept

from calib_core.archive.folder import save_session
from calib_core.formats.ply import ply_pieces
from calib_core.records import parse_session
from calib_core.simulation import SimulatedSession, simulate
from calib_core.simulation.part import build_part
from server.cli import main
from tests.verified import shifted, verified_session, written

_LANGUAGES, _PAPERS = ("en", "de", "zh"), ("A4", "letter")
_CONTROLS = re.compile(r"<(button|input|select|textarea|video|audio)\b")
"""What scrolls or unfolds on a screen is laid out for paper: there it would be cut."""
_WORD = re.compile(r'<word xMin="([\d.-]+)" yMin="([\d.-]+)" xMax="([\d.-]+)" yMax="([\d.-]+)">(.*?)</word>')
_HEAD = re.compile(r"<(h2|h3|caption)\b[^>]*>(.*?)</\1>", re.DOTALL)
_FOOT_PT = 50.0
"""Below it stand a page's number and the report's."""


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` prints each report in all languages on both papers.

    Where `SCANCELL_BENCH_KEEP` names a folder, the PDFs stay there to be looked at.
    """
    troubles: list[str] = []
    pages = printed = 0
    with TemporaryDirectory() as folder:
        keep = Path(os.environ.get("SCANCELL_BENCH_KEEP", folder))
        made = {name: Path(folder) / name for name in REPORTS}
        for number, name in enumerate(REPORTS):
            both = [(language, paper) for paper in _PAPERS for language in _LANGUAGES]
            for language, paper in both if full else (both[number % 6], both[(number + 4) % 6]):
                out = keep / f"{name}-{language}-{paper}.pdf"

                def look(name: str = name, out: Path = out, how: tuple[str, str] = (language, paper)) -> Any:
                    session = made[name] if made[name].exists() else REPORTS[name](made[name])
                    return looked_at(session, out, *how)

                count, found = kept(f"reports {out.stem}", look)
                pages, printed, troubles = pages + count, printed + 1, [*troubles, *found]
    said = f"{len(troubles)}{': ' if troubles else ''}{'; '.join(troubles[:4])}"
    return [
        Row(
            f"{len(REPORTS)} reports, {printed} prints, {pages} pages: cut, head alone, control, no number",
            "0",
            said,
            not troubles,
        )
    ]


def looked_at(session: Path, out: Path, language: str, paper: str) -> tuple[int, list[str]]:
    """Print a report; return how many pages it has, and what is wrong with them."""
    page = out.with_suffix(".html")
    for one in (page, out):
        status = main(["report", str(session), "--out", str(one), "--paper", paper, "--lang", language, "--quiet"])
        if status != 0:
            return 0, [f"{out.stem}: not made"]
    source = page.read_text(encoding="utf-8")
    found = [f"{out.stem}: {control.group(0)}" for control in _CONTROLS.finditer(source)]
    heads = {
        _plain(head)
        for head in re.findall(r"<(?:h2|h3|caption)\b[^>]*>(.*?)</(?:h2|h3|caption)>", source, re.DOTALL)
    }
    told = subprocess.run(["pdftotext", "-bbox", str(out), "-"], capture_output=True, text=True, check=True).stdout
    pages = re.findall(r'<page width="([\d.]+)" height="([\d.]+)">(.*?)</page>', told, re.DOTALL)
    for number, (width, height, content) in enumerate(pages, 1):
        words = [
            (*map(float, word.groups()[:4]), html.unescape(word.group(5))) for word in _WORD.finditer(content)
        ]
        where = f"{out.stem} page {number}"
        if any(left < 0 or right > float(width) or bottom > float(height) for left, _, right, bottom, _ in words):
            found.append(f"{where}: cut")
        lines = _lines(words)
        if not any(re.search(rf"\b{number}\D+{len(pages)}\b", line) for _, line in lines):
            found.append(f"{where}: no number")
        body = [line for bottom, line in lines if bottom < float(height) - _FOOT_PT]
        if body and _plain(body[-1]) in heads:
            found.append(f"{where}: the head {body[-1]!r} alone")
    return len(pages), found


def _plain(text: str) -> str:
    return " ".join(html.unescape(re.sub("<[^>]*>", " ", text)).split())


def _lines(words: list[tuple[float, float, float, float, str]]) -> list[tuple[float, str]]:
    """Return a page's lines from top to bottom, each with its lower edge."""
    lines: dict[int, list[tuple[float, float, str]]] = {}
    for left, _, _, bottom, word in words:
        lines.setdefault(round(bottom / 3), []).append((left, bottom, word))
    return [
        (max(bottom for _, bottom, _ in line), " ".join(word for _, _, word in sorted(line)))
        for _, line in sorted(lines.items())
    ]


def _simulated(
    scenario: str, seed: int, stage: str = "all", captures: int | None = None
) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        made = simulate(scenario, seed)
        few = made.session.model_copy(update={"captures": made.session.captures[:captures]})
        save_session(folder, few, made.files)
        main(["run", str(folder), "--stage", stage, "--quiet"])
        return folder

    return make


def _verified(seed: int, shift_mm: float = 0.0, of_sphere: int = 14) -> Callable[[Path], Path]:
    return lambda folder: written(told(verified_session(seed, shift_mm, of_sphere)), folder)


def _beside_its_nominal(folder: Path) -> Path:
    made, part = simulate("part", 3), build_part()
    nominal = b"".join(bytes(piece) for piece in ply_pieces(part.points_mm, triangles=part.triangles))
    record = made.session.to_json()
    record["cell"]["merge"] = {"voxel_mm": 0.8, "reference": "nominal.ply", "tolerance_mm": 0.2}
    save_session(folder, parse_session(record), {**made.files, "nominal.ply": nominal})
    main(["run", str(folder), "--stage", "merge", "--quiet"])
    return folder


def _wrong(folder: Path) -> Path:
    made = verified_session(9)
    captures = [
        shifted(made.session, c, [60.0 * (k % 3), 0, 0], "tcp") for k, c in enumerate(made.session.captures)
    ]
    return written(told(replace(made, session=made.session.model_copy(update={"captures": captures}))), folder)


def told(made: SimulatedSession) -> SimulatedSession:
    """Return a session that tells all that a report prints."""
    certificate = {
        "number": "K-12345-2025-04",
        "laboratory": "Example Calibration Laboratory",
        "due": "2028-03-01",
    }
    pieces = [
        {"kind": kind, "name": f"{kind} 7", "model": "Long Range 200 HD", "serial": f"S-{kind}-4711-0815"}
        for kind in ("sphere", "scanner", "robot")
    ]
    record = made.session.to_json()
    record["cell"]["equipment"] = [{**one, "certificate": certificate} for one in pieces]
    record["environment"] = {"ball_c": 21.4, "air_c": 22.0, "arm_c": 27.5}
    record["documentation"] = {
        "operator": "A. Weber", "place": "Hall 3, cell 4", "procedure": "QA-17 rev. 5",
        "report_number": "2026-0815",
        "customer": "Example Works, 1 Long Street, 12345 Town", "order": "4711",
    }  # fmt: skip
    return replace(made, session=type(made.session).model_validate(record))


REPORTS: Mapping[str, Callable[[Path], Path]] = {
    "tcp-pass": _simulated("tcp", 1),
    "tcp-warn": _simulated("tcp", 1, captures=5),
    "tcp-fail": _wrong,
    "turntable-pass": _simulated("turntable", 1, "turntable"),
    "turntable-warn": _simulated("turntable-wobble", 1, "turntable"),
    "chain-pass": _simulated("turntable", 2),
    "merge-pass": _simulated("part", 1),
    "verify-pass": _verified(3),
    "verify-undecided": _verified(4, of_sphere=2),
    "verify-fail": _verified(5, 1.0),
    "fixed-scanner": _simulated("fixed-scanner-turntable", 1),
    "two-scanners": _simulated("two-scanners-turntable", 1),
    "gantry": _simulated("gantry-turntable", 1),
    "linear-axis": _simulated("linear-turntable", 1),
    "positioner": _simulated("rail-positioner", 1),
    "merge-reference": _beside_its_nominal,
}
"""Of each stage, right and wrong."""
