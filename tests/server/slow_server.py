"""`scancell` whose solves do not end: `python -m tests.server.slow_server serve …`."""

import sys

from server.cli import main
from server.jobs import worker
from tests.server.slow_work import slow_solve

if __name__ == "__main__":
    worker.solve = slow_solve
    sys.exit(main(sys.argv[1:]))
