"""All codes, found by listing: the modules of `codes`, and those that other packages bring."""

import importlib
import pkgutil
from collections.abc import Iterator, Mapping
from functools import lru_cache
from types import ModuleType
from typing import Final

from calib_core.errors import NotFoundError
from calib_core.findings.code import Code
from calib_core.messages import message

_PACKAGE: Final = "calib_core.findings.codes"
_GROUP: Final = "scancell.findings"


@lru_cache(maxsize=1)
def areas() -> dict[str, list[Code]]:
    """Return the codes by area, the name of the module that they stand in."""
    found: dict[str, list[Code]] = {}
    for module in _modules():
        area = module.__name__.rpartition(".")[2]
        found.setdefault(area, []).extend(one for one in vars(module).values() if isinstance(one, Code))
    return found


def _modules() -> Iterator[ModuleType]:
    from importlib.metadata import entry_points

    package = importlib.import_module(_PACKAGE)
    for module in sorted(pkgutil.iter_modules(package.__path__), key=lambda one: one.name):
        yield importlib.import_module(f"{_PACKAGE}.{module.name}")
    for point in entry_points(group=_GROUP):
        yield point.load()


class _Table(Mapping[str, Code]):
    """The codes by their names; read when it is first asked."""

    def __getitem__(self, name: str) -> Code:
        return _by_name()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(_by_name())

    def __len__(self) -> int:
        return len(_by_name())


@lru_cache(maxsize=1)
def _by_name() -> dict[str, Code]:
    found: dict[str, Code] = {}
    for code in (code for some in areas().values() for code in some):
        if found.setdefault(code.name, code) is not code:
            raise ValueError(f"two codes named '{code.name}'")
    return dict(sorted(found.items()))


CODES: Final[Mapping[str, Code]] = _Table()


def code_named(name: str) -> Code:
    """Return a code; raises NotFoundError where there is none of this name."""
    if name not in CODES:
        to_do = message("Run `scancell findings`, or GET findings, for the list.")
        raise NotFoundError(message("a code of a finding"), f"'{name}'", to_do)
    return CODES[name]
