"""Open3D comes without the web framework that its drawing in notebooks loads, and draws there all the same."""

import subprocess
import sys

CODE = """
import sys
from calib_core.lean_open3d import open3d
ball = open3d().geometry.TriangleMesh.create_sphere()
lean = "dash" not in sys.modules
figure = open3d().visualization.get_plotly_fig([ball])
print(lean, type(figure).__name__, open3d() is sys.modules["open3d"])
"""


def test_the_web_framework_is_loaded_when_something_is_drawn() -> None:
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "Figure", "True"]
