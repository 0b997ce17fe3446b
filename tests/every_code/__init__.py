"""Every code by the rooms of their table: what raises it, and what is near it and does not."""

from importlib import import_module
from typing import Final

from calib_core.findings.table import areas
from tests.every_code.made import Case

CASES: Final[dict[str, tuple[Case, Case]]] = {
    name: case for room in areas() for name, case in import_module(f"{__name__}.{room}").CASES.items()
}
"""By code: a case that raises it, and a near one that does not."""
