"""The real sets calibrated through REST by the documentation's own script, against a live server."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from server.settings import Settings
from tests.server.live_server import serving

SCRIPT = Path(__file__).resolve().parents[2] / "docs" / "examples" / "calibrate_over_rest.py"


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(
    ("name", "translation_mm"),
    [
        ("tcp-sphere-80mm", (-149.6, 709.5, 487.2)),
        ("tcp-sphere-25mm", (79.0, -11.6, 263.4)),
    ],
)
def test_the_documented_script_calibrates_a_real_set(
    data_folder: Path, tmp_path: Path, name: str, translation_mm: tuple[float, ...]
) -> None:
    with serving(Settings(data=tmp_path, port=0, warm_up=False)) as client:
        address = str(client.base_url).removesuffix("/api/v1/")
        done = subprocess.run(
            [sys.executable, str(SCRIPT), str(data_folder / name), address],
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        session = client.get("/sessions").json()["items"][0]
        assert session["capture_count"] == len(list((data_folder / name / "captures").iterdir()))
        assert session["verdicts"]["tcp"] in ("pass", "warn")
    scatter = re.search(r"centre scatter ([\d.]+) mm", done.stdout)
    assert scatter, done.stdout
    assert float(scatter[1]) < 1.0  # poses read rightly
    rows = [[float(v) for v in line.split()] for line in done.stdout.splitlines()[-4:]]
    assert np.array(rows)[:3, 3] == pytest.approx(translation_mm, abs=2.0)
