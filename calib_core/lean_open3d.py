"""Open3D without what draws in a notebook, which loads a web framework: half a second and 40 MB less a process."""

import importlib
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

_DRAWING = "open3d.visualization.draw_plotly"


def open3d() -> Any:
    """Return the package Open3D; what draws with plotly is loaded when it is called."""
    if "open3d" not in sys.modules:
        stand_in = ModuleType(_DRAWING)
        for name in ("get_plotly_fig", "draw_plotly", "draw_plotly_server"):
            setattr(stand_in, name, _later(name))
        sys.modules[_DRAWING] = stand_in
        try:
            importlib.import_module("open3d")
        finally:
            sys.modules.pop(_DRAWING, None)
    return importlib.import_module("open3d")


def _later(name: str) -> Callable[..., Any]:
    def draw(*arguments: Any, **options: Any) -> Any:
        return getattr(importlib.import_module(_DRAWING), name)(*arguments, **options)

    return draw
