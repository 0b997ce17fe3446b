"""The language of the terminal: --lang, else SCANCELL_LANG, else English."""

import argparse
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from calib_core.messages import Catalogue
    from calib_core.records import Result, Severity


def spoken(options: argparse.Namespace) -> "Catalogue":
    """Return the language that is asked for; raises InputError where there is none of this name."""
    from calib_core.findings.catalogues import catalogue

    return catalogue(options.lang or os.environ.get("SCANCELL_LANG") or "en")


def lines_said(options: argparse.Namespace, text: str) -> str:
    """Return what a command prints: each line that is a message or in the catalogue, in the language asked for."""
    if (getattr(options, "lang", None) or os.environ.get("SCANCELL_LANG") or "en") == "en":
        return text
    from calib_core.messages import made_lately

    said = spoken(options)
    lines = ((line[: len(line) - len(line.lstrip())], line.strip()) for line in text.split("\n"))
    return "\n".join(indent + said.say(made_lately(line) or line) for indent, line in lines)


def result_as_read(
    result: "Result", said: "Catalogue", severities: "Mapping[str, Severity] | None" = None
) -> "Result":
    """Return a result in a language, with a cell's own severities."""
    from calib_core.archive.folder import result_data
    from calib_core.findings.reading import as_read
    from calib_core.findings.telling import told

    return type(result).model_validate(told(as_read(result_data(result), severities=severities), said))
