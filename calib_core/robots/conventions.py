"""The robot brands, and every convention that they bring."""

from collections.abc import Iterator, Mapping
from functools import cached_property

from calib_core.registry import Registry
from calib_core.robots.brand import Brand
from calib_core.robots.convention import Convention

BRANDS = Registry("a robot brand", "calib_core.robots", "BRAND", Brand, "scancell.brands")


class _Conventions(Mapping[str, Convention]):
    """All brands' conventions by name, by rank; looked up when first asked for."""

    @cached_property
    def _all(self) -> dict[str, Convention]:
        return {c.name: c for brand in sorted(BRANDS, key=lambda b: b.rank) for c in brand.conventions}

    def __getitem__(self, name: str) -> Convention:
        return self._all[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._all)

    def __len__(self) -> int:
        return len(self._all)


CONVENTIONS: Mapping[str, Convention] = _Conventions()
