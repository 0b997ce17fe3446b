"""The portable folder started where there is no network, and its demo session looked at; prints what was found.

A program of its own: server and browser must both be where only loopback is.
"""

import json
import os
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import httpx

from tests.windows.visit import page_of, scene_shown
from tests.windows.windows_python import outside, there

_START = """import subprocess, sys
sys.exit(subprocess.call(["cmd", "/c", ".\\\\Start.cmd", *sys.argv[2:]], cwd=sys.argv[1]))
"""  # with the folder: else cmd takes it for its own command `start`


def main() -> None:
    """Take the program that runs a Windows Python, the portable folder, and where the page's picture goes."""
    python, folder, picture = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
    assert {name for _, name in socket.if_nameindex()} == {"lo"}
    command = [python, "-c", _START, there(folder), "--port", "0", "--json"]
    server = subprocess.Popen(command, env=outside() | {"SCANCELL_WARM_UP": "false"}, stdout=subprocess.PIPE)
    try:
        assert server.stdout is not None
        address = json.loads(server.stdout.readline())["address"]
        with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
            with page_of(address) as page:
                page.get_by_role("button", name="Start the simulated cell").click()
                page.wait_for_url("**/sessions/*")
                session = page.url.rpartition("/")[2].partition("?")[0].partition("#")[0]
                for _ in range(5):  # its arcs are in the scene then
                    client.post(f"/sessions/{session}/sources/simulated/capture").raise_for_status()
                drawn = scene_shown(page, picture)
            captures = len(client.get(f"/sessions/{session}/captures").json()["items"])
        print(json.dumps({"captures": captures, "drawn": drawn}))
    finally:
        end_all_of(folder)
        server.kill()


def end_all_of(folder: Path) -> None:
    """End what runs from the folder: programs under Wine outlive their parents."""
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            told = (process / "cmdline").read_bytes().split(b"\0")[0].decode("utf-8", "replace")
            if there(folder).lower() in told.lower():
                os.kill(int(process.name), signal.SIGKILL)


if __name__ == "__main__":
    main()
