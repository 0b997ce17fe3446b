"""Real sets in archives: solved, packed, unpacked elsewhere and solved afresh, to the same numbers."""

import json
import shutil
from pathlib import Path

import pytest

from calib_core.review.same_numbers import TOLERANCE
from server.cli import main


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("name", ["tcp-sphere-80mm", "tcp-sphere-25mm"])
def test_replay_of_a_real_set_is_equal(data_folder: Path, tmp_path: Path, capsys, name: str) -> None:
    shutil.copytree(data_folder / name, tmp_path / name)
    main(["run", str(tmp_path / name), "--stage", "tcp"])
    file = tmp_path / "a.zip"
    assert main(["archive", "pack", str(tmp_path / name), "--out", str(file), "--no-scene"]) == 0
    shutil.rmtree(tmp_path / name)
    capsys.readouterr()
    assert main(["archive", "replay", str(file), "--json"]) == 0
    (stage,) = json.loads(capsys.readouterr().out)["stages"]
    assert stage["equal"]
    assert stage["numbers"] > 150
    assert stage["largest_relative"] <= TOLERANCE
