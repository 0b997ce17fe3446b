"""A report as PDF, printed by a Chromium, Chrome or Edge that the machine has: what a browser's own print gives.

A library of our own for PDF would lay the page out once more, and otherwise than the browser in which it is read.
"""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from calib_core.errors import InputError

_BROWSERS = (
    "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "microsoft-edge", "chrome", "msedge",
)  # fmt: skip
_PLACES = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "C:/Program Files/Google/Chrome/Application/chrome.exe",
    "C:/Program Files (x86)/Microsoft/Edge/Application/msedge.exe",
)
_LONGEST_S = 120


def browser() -> str | None:
    """Return the program that prints, None where the machine has none."""
    found = (shutil.which(name) for name in _BROWSERS)
    return next((path for path in (*found, *(p for p in _PLACES if Path(p).exists())) if path), None)


def pdf_of(page: str, where: str) -> bytes:
    """Return a page of HTML as PDF, on A4.

    Raises
    ------
    InputError
        If the machine has no browser that prints, or it does not.
    """
    program = browser()
    if program is None:
        to_do = "Install chromium; or write .html, and print that from a browser."
        raise InputError("Chromium, Chrome or Edge, which prints the PDF", "none of them", to_do, where)
    with tempfile.TemporaryDirectory(prefix="scancell-") as folder:
        source, target = Path(folder) / "report.html", Path(folder) / "report.pdf"
        source.write_text(page, encoding="utf-8")
        command = [
            program, "--headless", "--disable-gpu", "--no-first-run", "--no-pdf-header-footer",
            f"--user-data-dir={folder}/profile", f"--print-to-pdf={target}",
        ]  # fmt: skip
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            command.append("--no-sandbox")  # it refuses to start for root with one; the page has no scripts
        try:
            subprocess.run([*command, source.as_uri()], capture_output=True, timeout=_LONGEST_S, check=False)
        except (OSError, subprocess.TimeoutExpired) as error:
            got = f"{program}: {error}"[:200]
            raise InputError("a browser that prints", got, "Write .html, and print that.", where) from None
        if not target.exists():
            raise InputError("a browser that prints", f"{program}, which wrote no PDF", "Write .html.", where)
        return target.read_bytes()
