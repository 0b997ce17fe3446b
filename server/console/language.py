"""The language of the terminal: --lang, else SCANCELL_LANG, else English."""

import argparse
import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from calib_core.messages import Catalogue


def spoken(options: argparse.Namespace) -> "Catalogue":
    """Return the language that is asked for; raises InputError where there is none of this name."""
    from calib_core.findings.catalogues import catalogue

    return catalogue(options.lang or os.environ.get("SCANCELL_LANG") or "en")
