"""Open3D without what draws in a notebook, which loads a web framework: half a second and 40 MB less a process."""

import importlib
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

from calib_core.errors import InputError
from calib_core.messages import message
from calib_core.windows_runtime import require_runtime

_DRAWING = "open3d.visualization.draw_plotly"


def open3d() -> Any:
    """Return the package Open3D; what draws with plotly is loaded when it is called.

    Raises
    ------
    InputError
        If one of the system's libraries that it needs is missing, which pip cannot bring.
    """
    require_runtime()
    if "open3d" not in sys.modules:
        stand_in = ModuleType(_DRAWING)
        for name in ("get_plotly_fig", "draw_plotly", "draw_plotly_server"):
            setattr(stand_in, name, _later(name))
        sys.modules[_DRAWING] = stand_in
        try:
            importlib.import_module("open3d")
        except ModuleNotFoundError:
            raise
        except (ImportError, OSError) as error:  # the loader's own words name the file
            need = message("the system's libraries libegl1, libgl1, libgomp1 and libusb-1.0-0, for Open3D")
            to_do = message(
                "Install them, on Debian and Ubuntu with apt-get install libegl1 libgl1 libgomp1 libusb-1.0-0."
            )
            raise InputError(need, str(error), to_do) from None
        finally:
            sys.modules.pop(_DRAWING, None)
    return importlib.import_module("open3d")


def _later(name: str) -> Callable[..., Any]:
    def draw(*arguments: Any, **options: Any) -> Any:
        return getattr(importlib.import_module(_DRAWING), name)(*arguments, **options)

    return draw
