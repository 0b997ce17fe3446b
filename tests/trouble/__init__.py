"""Simulated sessions with what goes wrong in real cells, none of which the solvers' model was made from.

Every family of trouble is one module with a constant `TROUBLES`, turntables' are `tables.py`; the forward model
(`session.py`, `cell.py`, `arm.py`, `table_cell.py`) shares no code with the solvers.
"""

from importlib import import_module
from pkgutil import iter_modules

from tests.trouble.cell import Trouble
from tests.trouble.session import Troubled, troubled
from tests.trouble.table_cell import TableTrouble

__all__ = [
    "TableTrouble",
    "Trouble",
    "Troubled",
    "all_table_troubles",
    "all_troubles",
    "troubled",
]


def all_troubles() -> dict[str, Trouble]:
    """Return every class of trouble by name, in the order of the families' modules."""
    found: dict[str, Trouble] = {}
    for module in sorted(iter_modules(__path__), key=lambda m: m.name):
        family = import_module(f"{__name__}.{module.name}")
        for trouble in getattr(family, "TROUBLES", ()):
            found[f"{module.name}: {trouble.name}"] = trouble
    return found


def all_table_troubles() -> dict[str, TableTrouble]:
    """Return every class of trouble of a cell with a turntable, by name."""
    from tests.trouble.tables import TABLE_TROUBLES

    return {trouble.name: trouble for trouble in TABLE_TROUBLES}
