"""The workbench as a scheduled task of Windows, and its links: what needs no rights where it can do without.

A task rather than a service: a service must be a program of its own kind, and only administrators install one.
"""

import os
import struct
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath
from typing import Final
from xml.sax.saxutils import escape

from calib_core.disk import WINDOWS, remove_file, temporary_folder
from calib_core.errors import InputError
from calib_core.formats.shared.writing import write_atomically
from calib_core.messages import message

_CLASS: Final = bytes.fromhex("0114020000000000c000000000000046")
_HAS_NAME, _HAS_FOLDER, _HAS_ARGUMENTS, _IS_UNICODE, _HAS_EXPANDED = 0x4, 0x10, 0x20, 0x80, 0x200
_EXPANDED: Final = 0xA0000001
_EXPANDED_BYTES: Final = 0x314
_SIGNS: Final = 260
NORMAL: Final = 1

TASK = "scancell"
_CONSOLE = "oem" if WINDOWS else "cp850"
_PROGRAMS = "Microsoft/Windows/Start Menu/Programs"
_MINIMIZED = 7
_TASK_XML = """<?xml version="1.0" encoding="UTF-16"?>
<Task version="1.2" xmlns="http://schemas.microsoft.com/windows/2004/02/mit/task">
  <RegistrationInfo><Description>scancell, the workbench for scanning cells</Description></RegistrationInfo>
  <Triggers>{trigger}</Triggers>
  <Principals><Principal id="Author">{principal}<RunLevel>LeastPrivilege</RunLevel></Principal></Principals>
  <Settings>
    <MultipleInstancesPolicy>IgnoreNew</MultipleInstancesPolicy>
    <DisallowStartIfOnBatteries>false</DisallowStartIfOnBatteries>
    <StopIfGoingOnBatteries>false</StopIfGoingOnBatteries>
    <AllowHardTerminate>true</AllowHardTerminate>
    <AllowStartOnDemand>true</AllowStartOnDemand>
    <ExecutionTimeLimit>PT0S</ExecutionTimeLimit>
    <Priority>5</Priority>
    <RestartOnFailure><Interval>PT1M</Interval><Count>10</Count></RestartOnFailure>
  </Settings>
  <Actions Context="Author">
    <Exec>
      <Command>{program}</Command>
      <Arguments>{arguments}</Arguments>
      <WorkingDirectory>{folder}</WorkingDirectory>
    </Exec>
  </Actions>
</Task>
"""


@dataclass(frozen=True)
class Service:
    """What the task runs.

    Parameters
    ----------
    data : Path
        The data folder, absolute.
    port : int
    system : bool
        Whether it runs from the machine's start on, as Windows' own account for services; else as this user.
    """

    data: Path
    port: int
    system: bool


def install(service: Service) -> list[str]:
    """Make the task and the links; return what was made.

    Raises
    ------
    InputError
        If this is not Windows, or it refuses the task.
    """
    _require_windows()
    service.data.mkdir(parents=True, exist_ok=True)
    with temporary_folder() as folder:
        file = folder / "task.xml"
        file.write_text(task_xml(service, program()), encoding="utf-16")
        _schtasks("/Create", "/TN", TASK, "/XML", str(file), "/F")
    menu, startup = _links()
    write_atomically(menu, link(str(program()), serve_arguments(service, "--open"), str(service.data)))
    made = [f"task {TASK}", str(menu)]
    if not service.system:  # a task that starts at a logon needs an administrator, a link does not
        write_atomically(startup, link("%SystemRoot%\\System32\\schtasks.exe", f"/Run /TN {TASK}", "", _MINIMIZED))
        made.append(str(startup))
    return made


def start() -> str:
    """Have the task run now; raises InputError."""
    _require_windows()
    return _schtasks("/Run", "/TN", TASK)


def stop() -> str:
    """End what the task runs; raises InputError."""
    _require_windows()
    return _schtasks("/End", "/TN", TASK)


def status() -> str:
    """Return what Windows knows of the task; raises InputError."""
    _require_windows()
    return _schtasks("/Query", "/TN", TASK, "/V", "/FO", "LIST")


def remove() -> str:
    """End the task and remove it with its links; the data folder stays. Raises InputError."""
    _require_windows()
    for path in _links():
        remove_file(path, missing_ok=True)
    _schtasks("/End", "/TN", TASK, may_fail=True)  # it may not run
    return _schtasks("/Delete", "/TN", TASK, "/F")


def serve_arguments(service: Service, *more: str) -> str:
    """Return the arguments with which Python serves, as one line for Windows."""
    words = ["-m", "server.cli", "serve", "--port", str(service.port), "--data", str(service.data), *more]
    return subprocess.list2cmdline(words)


def task_xml(service: Service, python: PureWindowsPath) -> str:
    """Return the task's definition: without a limit of time, on battery too, started again where it fails."""
    own = "<LogonType>InteractiveToken</LogonType>"
    parts = {
        "trigger": "<BootTrigger><Enabled>true</Enabled></BootTrigger>" if service.system else "",
        "principal": "<UserId>S-1-5-19</UserId>" if service.system else own,  # LOCAL SERVICE
        "program": escape(str(python)),
        "arguments": escape(serve_arguments(service)),
        "folder": escape(str(service.data)),
    }
    return _TASK_XML.format(**parts)


def program() -> PureWindowsPath:
    """Return the Python that has no window, or the one that runs where there is none."""
    windowless = Path(sys.executable).with_name("pythonw.exe")
    return PureWindowsPath(windowless if windowless.is_file() else sys.executable)


def _links() -> tuple[Path, Path]:
    """Return where the links of the start menu and of the logon lie, those of this user."""
    programs = Path(os.environ.get("APPDATA", str(Path.home()))) / _PROGRAMS
    return programs / "scancell.lnk", programs / "Startup" / "scancell.lnk"


def _require_windows() -> None:
    if not WINDOWS:
        to_do = message("Use docs/examples/scancell.service for systemd.")
        raise InputError("Windows", "another system ({platform})", to_do, "service", platform=sys.platform)


def _schtasks(*words: str, may_fail: bool = False) -> str:
    done = subprocess.run(["schtasks", *words], capture_output=True, check=False)
    said, complained = _text(done.stdout), _text(done.stderr)
    if done.returncode and not may_fail:
        to_do = message(
            "With --system, open the prompt as administrator; `scancell service install` makes the task."
        )
        told = " ".join((complained or said).split())
        raise InputError("a task that Windows takes", told, to_do, f"schtasks {words[0]}")
    return said or complained


def _text(said: bytes) -> str:
    """Return what a program of Windows printed: in the console's code page, which may be UTF-8."""
    try:
        text = said.decode("utf-8")
    except UnicodeDecodeError:
        text = said.decode(_CONSOLE, "replace")
    return "\n".join(line.rstrip() for line in text.splitlines() if line.strip())


def link(target: str, arguments: str, folder: str, window: int = NORMAL) -> bytes:
    """Return a link's bytes.

    Parameters
    ----------
    target : str
        A program's whole path; variables such as `%SystemRoot%` may stand in it.
    arguments : str
        As one line.
    folder : str
        Where it runs; empty: where it likes.
    window : int
        How its window shows: 1 as usual, 7 minimized.
    """
    flags = _HAS_NAME | _HAS_ARGUMENTS | _IS_UNICODE | _HAS_EXPANDED | (_HAS_FOLDER if folder else 0)
    header = struct.pack("<I16sIIQQQIiIHHII", 0x4C, _CLASS, flags, 0, 0, 0, 0, 0, 0, window, 0, 0, 0, 0)
    texts = ["scancell", *([folder] if folder else []), arguments]
    strings = b"".join(struct.pack("<H", len(text)) + text.encode("utf-16-le") for text in texts)
    narrow = target.encode("cp1252", "replace").ljust(_SIGNS, b"\0")
    wide = target.encode("utf-16-le").ljust(2 * _SIGNS, b"\0")
    return header + strings + struct.pack("<II", _EXPANDED_BYTES, _EXPANDED) + narrow + wide + struct.pack("<I", 0)
