"""The scheduled task and the links, given to a program in place of Windows' schtasks."""

import socket
import struct
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path, PureWindowsPath
from xml.etree import ElementTree

import pytest

from server import windows_service
from server.cli import main
from server.commands import serve
from server.windows_service import Service, link, task_xml

_SCHTASKS = """#!{python}
import sys, pathlib
log = pathlib.Path({log!r})
with log.open("a", encoding="utf-8") as file:
    print(*sys.argv[1:], file=file)
if "/XML" in sys.argv:
    xml = pathlib.Path(sys.argv[sys.argv.index("/XML") + 1])
    log.with_suffix(".xml").write_bytes(xml.read_bytes())
if "/End" in sys.argv:
    sys.stderr.buffer.write("FEHLER: Die Aufgabe wird nicht ausgeführt.\\r\\n".encode("cp850"))
    sys.exit(1)
if "/Query" in sys.argv:
    sys.stdout.buffer.write("\\r\\nAufgabe: scancell\\r\\nNächste Laufzeit: N/V\\r\\n".encode("cp850"))
print("SUCCESS")
"""


@pytest.fixture
def tasks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where what schtasks was told is written; the user's folder is beside it."""
    programs = tmp_path / "programs"
    programs.mkdir()
    log = tmp_path / "told"
    (programs / "schtasks").write_text(_SCHTASKS.format(python=sys.executable, log=str(log)), encoding="utf-8")
    (programs / "schtasks").chmod(0o755)
    monkeypatch.setenv("PATH", str(programs))
    monkeypatch.setenv("APPDATA", str(tmp_path / "Zoë"))
    monkeypatch.setattr(windows_service, "WINDOWS", True)
    return log


def test_it_is_installed_for_a_user_without_rights_and_removed(tasks: Path, tmp_path: Path) -> None:
    data = tmp_path / "cells of ü"
    assert main(["service", "install", "--data", str(data), "--port", "8010"]) == 0
    task = ElementTree.fromstring(tasks.with_suffix(".xml").read_bytes().decode("utf-16").partition("?>")[2])
    names = {element.tag.rpartition("}")[2]: (element.text or "").strip() for element in task.iter()}
    assert names["ExecutionTimeLimit"] == "PT0S"  # Windows would end it after three days
    assert names["DisallowStartIfOnBatteries"] == names["StopIfGoingOnBatteries"] == "false"
    assert names["LogonType"] == "InteractiveToken"
    assert "BootTrigger" not in names
    assert names["Arguments"] == f'-m server.cli serve --port 8010 --data "{data}"'
    menu = tmp_path / "Zoë" / "Microsoft/Windows/Start Menu/Programs/scancell.lnk"
    startup = menu.parent / "Startup" / "scancell.lnk"
    assert "--open".encode("utf-16-le") in menu.read_bytes()
    assert "/Run /TN scancell".encode("utf-16-le") in startup.read_bytes()
    assert main(["service", "start"]) == 0
    assert main(["service", "remove"]) == 0
    assert not menu.exists()
    assert not startup.exists()
    assert data.is_dir()
    told = tasks.read_text(encoding="utf-8").splitlines()
    assert [line.split()[0] for line in told] == ["/Create", "/Run", "/End", "/Delete"]


def test_for_the_whole_machine_it_starts_with_it(tasks: Path, tmp_path: Path) -> None:
    assert main(["service", "install", "--data", str(tmp_path / "data"), "--system"]) == 0
    text = tasks.with_suffix(".xml").read_bytes().decode("utf-16")
    assert "<BootTrigger>" in text
    assert "S-1-5-19" in text
    assert not list((tmp_path / "Zoë").rglob("Startup/*"))


def test_what_windows_refuses_is_told(tasks: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["service", "stop"]) == 2
    assert "Die Aufgabe wird nicht ausgeführt." in capsys.readouterr().err


def test_what_windows_says_in_the_consoles_code_page_is_shown_line_by_line(
    tasks: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["service", "status"]) == 0
    assert capsys.readouterr().out.splitlines()[:2] == ["Aufgabe: scancell", "Nächste Laufzeit: N/V"]


def test_elsewhere_systemd_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["service", "install"]) == 2
    assert "scancell.service" in capsys.readouterr().err


def test_signs_of_xml_in_a_path_stay_what_they_are() -> None:
    service = Service(Path("/data & <more>"), 8000, False)
    task = ElementTree.fromstring(task_xml(service, PureWindowsPath("C:\\a & b\\pythonw.exe")).partition("?>")[2])
    (command,) = [e.text for e in task.iter() if e.tag.endswith("Command")]
    assert command == "C:\\a & b\\pythonw.exe"


def test_a_link_is_read_back_by_its_format() -> None:
    data = link("C:\\Program Files\\Python\\pythonw.exe", '-m server.cli "ü 1"', "D:\\cells", 7)
    size, _, flags = struct.unpack_from("<I16sI", data)
    assert (size, flags) == (0x4C, 0x4 | 0x10 | 0x20 | 0x80 | 0x200)
    assert struct.unpack_from("<I", data, 60) == (7,)
    at, texts = 0x4C, []
    for _ in range(3):
        (length,) = struct.unpack_from("<H", data, at)
        texts.append(data[at + 2 : at + 2 + 2 * length].decode("utf-16-le"))
        at += 2 + 2 * length
    assert texts == ["scancell", "D:\\cells", '-m server.cli "ü 1"']
    size, signature = struct.unpack_from("<II", data, at)
    assert (size, signature) == (0x314, 0xA0000001)
    target = data[at + 8 + 260 : at + size].decode("utf-16-le").rstrip("\0")
    assert target == "C:\\Program Files\\Python\\pythonw.exe"
    assert data[at + size :] == bytes(4)


def test_what_speaks_another_language_on_a_port_is_no_workbench() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other, ThreadPoolExecutor(1) as pool:

        def answer() -> None:
            for _ in ("http", "https"):
                with other.accept()[0] as caller:
                    caller.recv(4096)
                    caller.sendall(b"\x15\x03\x03\x00\x02\x02\x46 220 ready\r\n\r\n")

        answered = pool.submit(answer)
        assert serve._running("127.0.0.1", other.getsockname()[1]) is None
        answered.result()


@pytest.mark.thorough
def test_serve_opens_the_browser_once_it_serves_and_where_it_runs_already(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The browser is a program that writes down what it is asked for."""
    asked = tmp_path / "asked"
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" >> {asked}\n', encoding="utf-8")
    browser.chmod(0o755)
    monkeypatch.setenv("BROWSER", f"{browser} %s")
    monkeypatch.setenv("SCANCELL_WARM_UP", "false")
    command = [
        sys.executable,
        "-m",
        "server.cli",
        "serve",
        "--port",
        "0",
        "--data",
        str(tmp_path / "data"),
        "--open",
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            address = server.stdout.readline().split(" at ")[1].split()[0]
            host, port = address.removeprefix("http://").split(":")
            assert serve._running(host, int(port)) == address
            assert main(["serve", "--host", host, "--port", port, "--open"]) == 0
            assert asked.read_text().split() == [address, address]
        finally:
            server.terminate()
            server.wait(60)
    assert serve._running(host, int(port)) is None
