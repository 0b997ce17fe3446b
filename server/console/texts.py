"""Texts that all commands share in each language: severities, and what is wrong with a command's words."""

import argparse
import os
from collections.abc import Sequence
from typing import Any, Final

from calib_core.evidence.text import padded
from calib_core.findings.catalogues import catalogue
from calib_core.messages import Catalogue, templates

_SEVERITIES: Final = templates(("error", "warning", "note"))
_PARSERS_OWN: Final = templates((
    "argument %(argument_name)s: %(message)s",
    "the following arguments are required: %s",
    "one of the arguments %s is required",
    "invalid choice: %(value)r (choose from %(choices)s)",
    "invalid %(type)s value: %(value)r",
    "expected one argument",
    "expected at most one argument",
    "expected at least one argument",
    "not allowed with argument %s",
    "ignored explicit argument %r",
    "usage: ",
    "options",
    "actions",
    "positional arguments",
    "show this help message and exit",
))  # fmt: skip


def severity_said(severity: str, said: Catalogue) -> str:
    """Return a finding's severity in a language, as the first column of a list."""
    return padded(said.say(severity), 8)


def say_usage_errors(words: Sequence[str]) -> Catalogue | None:
    """Let the parser's errors be in the language asked for; return it, or None for English.

    The parser takes its texts from a function of its module: there is no other way in than that one. Of help,
    what a command is for is said; what each option takes stays English, as its name and value do.
    """
    asked = next((words[k + 1] for k, word in enumerate(words[:-1]) if word == "--lang"), "")
    asked = next((word[7:] for word in words if word.startswith("--lang=")), asked)
    asked = asked or os.environ.get("SCANCELL_LANG") or "en"
    module: Any = argparse
    module._ = str
    if asked not in ("de", "zh"):
        return None
    said = catalogue(asked)

    def say(text: str) -> str:
        return said.say(text) if text in _PARSERS_OWN else text

    module._ = say
    return said
