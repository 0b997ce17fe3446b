"""Numbers as they are shown: with unit, expanded uncertainty, and no more digits than that allows."""

import math
import re
from collections.abc import Iterable, Sequence
from decimal import Decimal
from typing import Final

from calib_core.records.evidence import Quantity

COVERAGE: Final = 2.0
"""The factor k between standard and expanded uncertainty: about 95 %."""

_DECIMAL: Final = re.compile(r"(?<![\w./\\])(?<!\w-)\d[\d\u202f]*\.\d+(?![\w/\\]|\.\w)")
_VERBATIM: Final = re.compile(r"(`[^`]*`|„[^“]*“|'[^']*'|\"[^\"]*\"|&quot;.*?&quot;|&#x27;.*?&#x27;)")
_MOST_DECIMALS: Final = 9
_NOTHING: Final = "–"
_SIGNIFICANT: Final = 3


def quantity(value: float | None, unit: str = "", sigma: float | None = None) -> Quantity:
    """Return a number with twice its standard deviation; the uncertainty keeps two digits, a lone number three.

    What is not finite is None: there is no such number.
    """
    finite = value is not None and math.isfinite(value)
    if sigma is None or not math.isfinite(sigma):
        return Quantity(value=value if finite else None, unit=unit, decimals=decimals_of([value]))
    return Quantity(
        value=value if finite else None,
        unit=unit,
        uncertainty=COVERAGE * sigma,
        decimals=decimals_of_uncertainty(COVERAGE * sigma),
    )


def rms(value: float | None, unit: str) -> Quantity:
    """Return a root mean square: of some ten captures it is known to a tenth, so two digits, three after a 1."""
    shown = quantity(value, unit)
    if shown.value is None or f"{abs(shown.value):e}"[0] == "1":
        return shown
    return shown.model_copy(update={"decimals": max(shown.decimals - 1, 0)})


def plus_minus(sigma: float, unit: str) -> Quantity:
    """Return an expanded uncertainty alone: ± 0.08 mm."""
    return quantity(None, unit, sigma)


def fixed(value: float | None, decimals: int, unit: str = "") -> Quantity:
    """Return a number with so many decimals; counts have none."""
    return Quantity(
        value=value if value is not None and math.isfinite(value) else None, unit=unit, decimals=decimals
    )


def same_decimals(shown: Sequence[Quantity]) -> list[Quantity]:
    """Return numbers that stand together with the decimals of the one that has most."""
    most = max(one.decimals for one in shown)
    return [one.model_copy(update={"decimals": most}) for one in shown]


def limit_of(limit: float, shown: Quantity) -> Quantity:
    """Return a limit as it was told, with no fewer decimals than the figure that it is held against."""
    exponent = Decimal(repr(limit)).as_tuple().exponent
    told = -exponent if isinstance(exponent, int) else 0
    return fixed(limit, min(max(told, shown.decimals), _MOST_DECIMALS), shown.unit)


def decimals_of_uncertainty(uncertainty: float) -> int:
    """Return how many decimals leave an uncertainty two digits."""
    if not (math.isfinite(uncertainty) and uncertainty > 0):
        return 4
    return min(max(1 - math.floor(math.log10(uncertainty)), 0), _MOST_DECIMALS)


def decimals_of(values: Iterable[float | None]) -> int:
    """Return how many decimals show the largest of some numbers with three digits."""
    largest = max((abs(v) for v in values if v is not None and math.isfinite(v)), default=0.0)
    if largest == 0:
        return 0
    return min(max(_SIGNIFICANT - 1 - math.floor(math.log10(largest)), 0), 6)


def number_text(value: float | None, decimals: int) -> str:
    """Return a number with its decimals and a true minus sign; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return _NOTHING
    text = f"{round(value, decimals) + 0.0:.{decimals}f}"  # + 0.0: no minus zero
    whole, _, rest = text.partition(".")
    if len(whole.lstrip("-")) > 4:
        whole = f"{int(whole):,}".replace(",", "\u202f")
    return (f"{whole}.{rest}" if rest else whole).replace("-", "−")


def quantity_text(shown: Quantity | None) -> str:
    """Return ``140.32 ± 0.08 mm``, ``± 0.08 mm``, ``0.043 mm`` or a dash."""
    if shown is None or (shown.value is None and shown.uncertainty is None):
        return _NOTHING
    parts: list[str] = []
    if shown.value is not None:
        parts.append(number_text(shown.value, shown.decimals))
    if shown.uncertainty is not None:
        parts.append(f"± {number_text(shown.uncertainty, shown.decimals)}")
    return with_unit(" ".join(parts), shown.unit)


def with_unit(text: str, unit: str) -> str:
    """Return a number's text with its unit; degrees follow without a space."""
    return text + unit if unit in ("", "°") else f"{text}\u202f{unit}"


def pointed(text: str, language: str) -> str:
    """Return text with the decimal sign of a language; what is quoted, versions and names keep their points.

    Numbers in a row are then apart by semicolons.
    """
    if language != "de" or "." not in text:
        return text
    parts = _VERBATIM.split(text)
    for place in range(0, len(parts), 2):
        told = _DECIMAL.sub(lambda found: found[0].replace(".", ","), parts[place])
        parts[place] = re.sub(r"(\d,\d+), (?=[−±-]?\d+(?:,\d|$))", r"\1; ", told)
    return "".join(parts)
