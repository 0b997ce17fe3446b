"""Each way to a wrong release is refused or marked with its reason, by REST and by the command line."""

from collections.abc import Callable, Iterator

import pytest

from tests.server.wrong_releases import BY_COMMAND, WAYS, World, world


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    with world(tmp_path_factory.mktemp("releases")) as made:
        yield made


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_it_is_refused_or_marked(way: Callable[[World], str], here: World) -> None:
    for channel in (way, BY_COMMAND.get(way)):
        assert channel is None or channel(here).startswith(("refused", "marked"))
