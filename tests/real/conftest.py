"""Real measurements lie beside the project, in ../shared/data; they are never part of it."""

import os
from pathlib import Path

import pytest

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"


@pytest.fixture(scope="session")
def data_folder() -> Path:
    if DATA.is_dir():
        return DATA
    message = "the real measurements are not beside the project (../shared/data)"
    if os.environ.get("CI") == "true":
        pytest.fail(message)
    pytest.skip(message)
