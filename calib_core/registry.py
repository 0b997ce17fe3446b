"""What exists, found by listing: one module or folder an entry, and entries that other packages bring.

A registry looks through a package's modules for a constant (`FORMAT`, `BRAND`, `EXPORT`, `STAGE` …) and through
the entry points of a group.  Whoever adds an entry opens one file; whoever needs the list asks the registry.
"""

import importlib
import pkgutil
from collections.abc import Iterator
from functools import cached_property
from typing import Generic, Protocol, TypeVar

from calib_core.errors import InputError


class Named(Protocol):
    """An entry: it has a name that users write."""

    @property
    def name(self) -> str:
        """The name, unique in its registry."""
        ...


Entry = TypeVar("Entry", bound=Named)


class Registry(Generic[Entry]):
    """The entries of one kind.

    Parameters
    ----------
    what : str
        What an entry is, as a sentence names it: "an export", "a file format".
    package : str
        The package whose modules and subpackages are looked through; its modules must be light to import.
    constant : str
        The name that an entry has in its module.
    kind : type
        What the constant must be.
    group : str, optional
        The group of entry points by which other packages bring entries.
    folders : bool
        Whether an entry is a folder: the package's plain modules are then passed over.
    """

    def __init__(
        self,
        what: str,
        package: str,
        constant: str,
        kind: type[Entry],
        group: str | None = None,
        *,
        folders: bool = False,
    ) -> None:
        self._what, self._package, self._constant, self._kind, self._group = what, package, constant, kind, group
        self._folders = folders

    def __iter__(self) -> Iterator[Entry]:
        return iter(self._entries.values())

    def names(self) -> list[str]:
        """Return the names of all entries."""
        return list(self._entries)

    def get(self, name: str, where: str = "") -> Entry:
        """Return an entry by its name; raises InputError, which lists the names, where there is none."""
        entry = self._entries.get(name)
        if entry is None:
            need = "{what} among {entries}"
            to_do = "Name one of these."
            raise InputError(need, f"'{name}'", to_do, where, what=self._what, entries=", ".join(self._entries))
        return entry

    @cached_property
    def _entries(self) -> dict[str, Entry]:
        """Find the entries, own ones first; one from elsewhere may not replace one of ours."""
        found: dict[str, Entry] = {}
        for entry in (*self._own(), *self._from_elsewhere()):
            if found.setdefault(entry.name, entry) is not entry:
                raise ValueError(f"two entries named '{entry.name}' in {self._package} and {self._group}")
        return found

    def _own(self) -> Iterator[Entry]:
        package = importlib.import_module(self._package)
        for module in sorted(pkgutil.iter_modules(package.__path__), key=lambda found: found.name):
            if self._folders and not module.ispkg:
                continue
            entry = getattr(importlib.import_module(f"{self._package}.{module.name}"), self._constant, None)
            if isinstance(entry, self._kind):
                yield entry

    def _from_elsewhere(self) -> Iterator[Entry]:
        if self._group is None:
            return
        from importlib.metadata import entry_points  # takes longer than the rest of `scancell --help`

        for point in entry_points(group=self._group):
            entry = point.load()
            if not isinstance(entry, self._kind):
                raise TypeError(f"the entry point '{point.name}' of '{self._group}' is no {self._kind.__name__}")
            yield entry
