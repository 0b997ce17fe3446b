"""What the program notices, as data: findings with codes, one verdict, texts in any language.

How to convert a place that judges (all you need to know is on this page)
------------------------------------------------------------------------
1. **Write the code** in `calib_core/findings/codes/AREA.py` (one file an area; a new file is found by listing)::

       MOVED_SPHERE = Code(
           "moved-sphere",                    # lower-case words with hyphens; the constant is its name
           "warning",                         # "error" | "warning" | "note": here and nowhere else
           text="The sphere stands {shift_mm:.2f} mm elsewhere from {since} on.",
           to_do="Take the captures of one side again.",
           meaning="…", decided="…", usual_causes="…",        # its page: English, Markdown, whole sentences
           since="0.2",
       )

   `text` and `to_do` are whole sentences with named places in Python's format; the unit of a value ends its name
   (`shift_mm`) and stands in the text.  `{captures}` names the captures.  Further fields, all optional:

   - plural forms: `text=Plural("{captures} is not used.", "{captures} are not used.", by="captures")`;
   - one code, several sentences: `text={"settled": "…", "open": "…"}, by="course"`: the value `course` chooses;
   - `reason="lies {distance_mm:.2f} mm off"`: what the row of each of its captures says, which is not used then;
   - `fixed=True`: its severity cannot be changed for a cell (what makes an answer undetermined);
   - `behind=("poses-do-not-fit",)`: it follows from these: with one of them it is kept, but not said nor counted;
   - `title="The sphere moved before {since}"`: the headline of its remedy.

2. **Give the finding** where you notice it: `codes.MOVED_SPHERE(captures, shift_mm=3.2, since="p07")`.  A value
   may be a `Message` (`calib_core.messages`); `each={"p03": {"distance_mm": 1.2}}` holds values that differ by
   capture, `remedy=RootCause(…)` is what Apply changes, `where="cell.robot"` names what is no capture.  Captures
   with one cause are one finding.  Detectors stay with what they look at, return `list[Finding]`, decide no more.

3. **Build once**: `TcpResult(…, **judgement(findings))`, or `judged(result, more)` for a finished result.
   Verdict, `warnings`, `notes` and `causes` are made there, the captures' reasons by `reasons_of(findings)`.
   Nobody sets a verdict, and nobody looks into a sentence: ask `has(findings, codes.MOVED_SPHERE)`.

4. **Translate**: `make catalogues` takes up new texts into `locale/de/AREA.po` and `locale/zh/AREA.po` and writes
   `docs/findings/`; fill what is empty.  `tests/core/test_findings.py` names what misses.  Where main moved:
   rebase, take either side of a .po, run `make catalogues` again.

Texts that are no findings (refusals, labels, guide) are messages: `message("…{count}…", count=3)`, see
`calib_core/messages.py`; they are translated by the same command, into the catalogue of their room.  Records keep
them as English texts; `telling.told` says a whole answer in a language, at the edge.
"""

from calib_core.findings.bridge import complete_measured, findings_in
from calib_core.findings.catalogues import LANGUAGES, catalogue
from calib_core.findings.code import Code, Plural
from calib_core.findings.judgement import (
    about,
    causes_of,
    has,
    has_code,
    judged,
    judgement,
    measured_judgement,
    measured_with,
    message_of_finding,
    reasons_of,
    sentence_of,
    to_do_of,
    verdict_of,
    worst_of,
)
from calib_core.findings.reading import (
    as_read,
    findings_as_read,
    guide_as_read,
    in_language,
    measured_as_read,
    with_severities,
)
from calib_core.findings.table import CODES, code_named
from calib_core.records.findings import Finding, Severity

__all__ = [
    "CODES", "LANGUAGES", "Code", "Finding", "Plural", "Severity", "about", "as_read", "catalogue",
    "causes_of", "code_named", "complete_measured", "findings_as_read", "findings_in", "guide_as_read", "has",
    "has_code", "in_language", "judged", "judgement", "measured_as_read", "measured_judgement",
    "measured_with", "message_of_finding", "reasons_of", "sentence_of", "to_do_of", "verdict_of",
    "with_severities", "worst_of"
]  # fmt: skip
