"""Open3D comes without the web framework that its drawing in notebooks loads, and draws there all the same."""

import subprocess
import sys
from pathlib import Path

import pytest

CODE = """
import sys
from calib_core.lean_open3d import open3d
ball = open3d().geometry.TriangleMesh.create_sphere()
lean = "dash" not in sys.modules
figure = open3d().visualization.get_plotly_fig([ball])
print(lean, type(figure).__name__, open3d() is sys.modules["open3d"])
"""


@pytest.mark.thorough
def test_the_web_framework_is_loaded_when_something_is_drawn() -> None:
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "Figure", "True"]


def test_a_library_of_the_system_that_is_missing_is_named_with_the_packages(tmp_path: Path) -> None:
    missing = "libusb-1.0.so.0: cannot open shared object file: No such file or directory"
    (tmp_path / "open3d.py").write_text(f"raise ImportError({missing!r})")  # as the loader says it of Open3D's own
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); from calib_core.lean_open3d import open3d; open3d()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    said = done.stderr.splitlines()[-1]
    assert said.startswith("calib_core.errors.InputError: ")
    assert missing in said
    assert "apt-get install libegl1 libgl1 libgomp1 libusb-1.0-0" in said
