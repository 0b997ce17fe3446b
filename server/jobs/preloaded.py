"""What the server's processes have imported and loaded before they begin: what they are forked from imports this.

Kernels that no cache holds are not compiled here, for a process that is wanted meanwhile would have to wait: the
first that needs them compiles them, and says so.
"""

import gc
from importlib import import_module

from calib_core.compiled import on_compiling
from server import measuring
from server.heap import give_back
from server.jobs import worker

_OF_PAGES = (
    "server.jobs.page_process",
    "server.page_questions",
    "calib_core.guidance.cell_plan",
    "calib_core.guidance.pose_list",
    "calib_core.guidance.interim_estimate",
)


class _NotCompiledError(Exception):
    pass


def _load() -> None:
    for name in _OF_PAGES:
        import_module(name)

    def stop() -> None:
        raise _NotCompiledError

    on_compiling.append(stop)
    try:
        measuring.warm_up()
        worker.warm_up()
    except _NotCompiledError:
        pass
    finally:
        on_compiling.remove(stop)
    gc.collect()
    gc.freeze()  # what is forked shares it as long as nobody writes into it, as a look for garbage would
    give_back()


_load()
