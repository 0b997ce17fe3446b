"""The loopback network has one place for a GigE Vision camera: tests that serve one go one after the other."""

import fcntl
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

FAKE = shutil.which("arv-fake-gv-camera-0.8")


@contextmanager
def only_camera() -> Iterator[None]:
    with (Path(tempfile.gettempdir()) / "scancell-gige-tests.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


@contextmanager
def aravis_camera() -> Iterator[None]:
    process = subprocess.Popen([str(FAKE), "-i", "127.0.0.1"])
    try:
        yield
    finally:
        process.kill()
        process.wait()
