"""The server's heap: threads that come and go leave no heaps of their own behind."""

import subprocess
import sys

import pytest

_COUNTED = """
import ctypes, sys, tempfile, threading
{first}
def work():
    libc.malloc(5000)
    together.wait()
libc = ctypes.CDLL(None)
together = threading.Barrier(12)
threads = [threading.Thread(target=work) for _ in range(12)]
for thread in threads: thread.start()
for thread in threads: thread.join()
libc.fopen.restype = ctypes.c_void_p
with tempfile.NamedTemporaryFile() as file:
    told = ctypes.c_void_p(libc.fopen(file.name.encode(), b"w"))
    libc.malloc_info(0, told)
    libc.fclose(told)
    print(file.read().count(b"<heap nr="))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="settings of the C library of Linux")
def test_threads_share_one_heap() -> None:
    def heaps(first: str) -> int:
        words = [sys.executable, "-c", _COUNTED.format(first=first)]
        return int(subprocess.run(words, capture_output=True, check=True).stdout)

    if heaps("") == 1:
        pytest.skip("a C library whose threads share a heap anyway")
    assert heaps("from server.heap import keep_little; keep_little()") == 1
