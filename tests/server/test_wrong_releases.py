"""Each way to a wrong release is refused or marked with its reason."""

from collections.abc import Callable, Iterator

import pytest

from tests.server.wrong_releases import WAYS, World, world


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    with world(tmp_path_factory.mktemp("releases")) as made:
        yield made


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_it_is_refused_or_marked(way: Callable[[World], str], here: World) -> None:
    assert way(here).startswith(("refused", "marked"))
