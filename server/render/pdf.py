"""A report as PDF, printed by a Chromium, Chrome or Edge that the machine has: what a browser's own print gives.

A library of our own for PDF would lay the page out once more, and otherwise than the browser in which it is read.
"""

import os
import re
import shutil
import signal
import subprocess
from contextlib import suppress
from pathlib import Path

from calib_core.disk import temporary_folder
from calib_core.errors import InputError
from calib_core.messages import message

_BROWSERS = (
    "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "microsoft-edge", "chrome", "msedge",
    "chromium-headless-shell",
)  # fmt: skip
_PLACES = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
)
_FOLDERS_OF_WINDOWS = ("ProgramFiles", "ProgramFiles(x86)", "ProgramW6432", "LOCALAPPDATA")
"""Variables that name where programs are: of all users, of 32 bits, of one user without rights."""
_BELOW_THEM = (
    "Microsoft/Edge/Application/msedge.exe",
    "Google/Chrome/Application/chrome.exe",
    "Chromium/Application/chrome.exe",
)
_LONGEST_S = 120.0
_POLICY = (
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
    'img-src data:">'
)
"""The page runs and loads nothing, whatever a session's texts hold."""

_LARGEST_BYTES = 200_000_000
_CHINESE = re.compile("[\u4e00-\u9fff]")


def browser() -> str | None:
    """Return the program that prints, None where the machine has none."""
    found = next((path for name in _BROWSERS if (path := shutil.which(name))), None)
    folders = [folder for name in _FOLDERS_OF_WINDOWS if (folder := os.environ.get(name))]
    places = [*_PLACES, *(f"{folder}/{below}" for below in _BELOW_THEM for folder in folders)]
    return found or next((place for place in places if Path(place).is_file()), None)


def _lacks_characters(page: str) -> bool:
    """Return whether a page has Chinese characters and this machine, by fontconfig, no font for them."""
    lister = shutil.which("fc-list")  # Windows and macOS have none, and such fonts always
    if lister is None or not _CHINESE.search(page):
        return False
    with suppress(OSError, subprocess.SubprocessError):
        return not subprocess.run([lister, ":lang=zh"], capture_output=True, timeout=30, check=True).stdout.strip()
    return False


def pdf_of(
    page: str, where: str, longest_s: float = _LONGEST_S, instead: str = "Write .html, and print that."
) -> bytes:
    """Return a page of HTML as PDF, on A4.

    Parameters
    ----------
    page : str
        It runs nothing, and the browser reaches no network.
    where : str
        What is asked for, for an error.
    longest_s : float, optional
        After that the browser and all that it started are ended.
    instead : str, optional
        What to do where nothing can be printed.

    Raises
    ------
    InputError
        If the machine has no browser that prints, or it does not, or no font for the page's characters.
    """
    program = browser()
    if program is None:
        to_do = message("Install one of them where this runs. {instead}", instead=instead)
        raise InputError("Chromium, Chrome or Edge, which prints the PDF", "none", to_do, where)
    if _lacks_characters(page):
        to_do = message(
            "Install one where this runs: on Debian or Ubuntu, fonts-noto-cjk. {instead}", instead=instead
        )
        raise InputError("a font with Chinese characters, else each is an empty box", "none", to_do, where)
    with temporary_folder() as folder:
        source, target = folder / "report.html", folder / "report.pdf"
        source.write_text(page.replace("<head>", f"<head>{_POLICY}", 1), encoding="utf-8")
        command = [
            program, "--headless", "--disable-gpu", "--no-first-run", "--no-pdf-header-footer",
            "--disable-background-networking",
            "--host-resolver-rules=MAP * ~NOTFOUND", "--proxy-server=127.0.0.1:9",
            "--proxy-bypass-list=<-loopback>",
            f"--user-data-dir={folder}/profile", f"--print-to-pdf={target}",
        ]  # fmt: skip
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            command.append("--no-sandbox")  # it refuses to start for root with one; the page has no scripts
        try:
            _run([*command, source.as_uri()], longest_s)
        except subprocess.TimeoutExpired:
            got = message(
                "{program}, which was not done within {longest_s:g} s", program=program, longest_s=longest_s
            )
            raise InputError("a browser that prints", got, instead, where) from None
        except OSError as error:
            raise InputError("a browser that prints", f"{program}: {error}"[:200], instead, where) from None
        if not target.exists():
            need = "a browser that prints"
            raise InputError(need, "{program}, which wrote no PDF", instead, where, program=program)
        if target.stat().st_size > _LARGEST_BYTES:
            need = "a PDF of {largest_bytes} bytes at most"
            raise InputError(need, "a larger one", instead, where, largest_bytes=_LARGEST_BYTES)
        return target.read_bytes()


def _run(command: list[str], longest_s: float) -> None:
    """Run a program, and end all that it started where it takes too long; raises as `subprocess.run`."""
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    ) as process:
        try:
            process.wait(longest_s)
        except BaseException:
            if hasattr(os, "killpg"):
                with suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
            process.kill()
            raise
