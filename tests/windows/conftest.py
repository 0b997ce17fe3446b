"""What tests of this folder share: a solved session, as those of archives have it, and a Windows Python."""

from tests.core.conftest import solved_folder  # noqa: F401 (fixture)
from tests.windows.windows_python import figure, place, program  # noqa: F401 (fixtures)
