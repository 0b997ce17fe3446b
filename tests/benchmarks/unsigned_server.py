"""`scancell` that signs no capture as it stores it: `python -m tests.benchmarks.unsigned_server serve …`."""

import sys

import server.store.capture_writes
from server.cli import main

if __name__ == "__main__":
    server.store.capture_writes.row_seal = lambda *_: None
    sys.exit(main(sys.argv[1:]))
