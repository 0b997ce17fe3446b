"""Results of worker processes come as files: what goes through the pipe to the server stays small.

A worker may be killed at any moment: because its job is cancelled or takes too long, or because memory ran out.
Where that cuts a long message in the pipe, the executor's thread in the server waits for the rest for ever: no job
of the pool ends any more, and the server cannot be stopped.  A file's name is written in one piece.
"""

import os
import pickle
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from calib_core.disk import remove_file


def result_to_file(folder: str, work: Callable[[], Any]) -> str:
    """Do some work, in a worker process; return the file in a folder that holds its result."""
    result = work()
    number, name = tempfile.mkstemp(dir=folder)
    with os.fdopen(number, "wb") as file:
        pickle.dump(result, file, pickle.HIGHEST_PROTOCOL)
    return name


def result_from_file(name: str) -> Any:
    """Return the result that a file holds, and remove it."""
    path = Path(name)
    result = pickle.loads(path.read_bytes())  # a worker wrote it, in a folder that only this user may open
    remove_file(path)
    return result
