"""`scancell run` on measurements of real cells: nothing is told but the sphere's diameter and the convention."""

import json
import shutil

import numpy as np
import pytest

from server.cli import main


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(
    ("name", "left_out_mm", "translation_mm", "wpr_deg"),
    [
        ("tcp-sphere-80mm", 0.19, (-149.6, 709.5, 487.2), (179.5, 0.45, -91.8)),
        ("tcp-sphere-25mm", 0.60, (79.0, -11.6, 263.4), (-178.1, -0.16, 131.3)),
    ],
)
def test_a_real_cell_is_solved(data_folder, tmp_path, capsys, name, left_out_mm, translation_mm, wpr_deg):
    folder = tmp_path / name
    shutil.copytree(data_folder / name, folder, copy_function=shutil.copyfile)
    folder.chmod(0o755)  # the measurements themselves are read-only
    assert main(["run", str(folder), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)["results"]["tcp"]
    assert printed["leave_one_out_surface_rms_mm"] <= left_out_mm
    assert printed["verdict"] in ("pass", "warn")
    assert all(row["used"] for row in printed["residuals"])
    assert main(["export", str(folder), "--format", "json"]) == 0
    fanuc = json.loads(capsys.readouterr().out)["conventions"]["fanuc"]["numbers"]
    np.testing.assert_allclose(fanuc[:3], translation_mm, atol=2)
    turned = (np.array(fanuc[3:]) - wpr_deg + 180) % 360 - 180
    np.testing.assert_allclose(turned, 0, atol=2)
    assert main(["check", str(folder)]) == 0
