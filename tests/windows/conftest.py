"""A solved session, as the tests of archives have it."""

from tests.core.conftest import solved_folder  # noqa: F401 (fixture)
