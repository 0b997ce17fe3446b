"""Every pose convention that a robot brand brings; `numbers.py` turns numbers into a pose by one."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any

from calib_core.poses.convention import Convention
from calib_core.registry import Registry


class Writer:
    """Whoever writes poses: a brand, as far as its conventions are asked for.

    Attributes
    ----------
    name : str
        As `--brand` and the exports name it.
    conventions : tuple of Convention
        How its controllers write a pose; none where it is another brand's.
    rank : int
        Where its conventions stand in lists: those of no brand and the most common brands first.
    """

    name: str
    conventions: tuple[Convention, ...] = ()
    rank: int = 1000

    def exports(self) -> tuple[Any, ...]:
        """Return the exports that it writes, as `calib_core.exports` takes them; none where it writes none."""
        return ()


WRITERS = Registry("a robot brand", "calib_core.robots", "BRAND", Writer, "scancell.brands")


class _Conventions(Mapping[str, Convention]):
    """All brands' conventions by name, by rank; looked up when first asked for."""

    @cached_property
    def _all(self) -> dict[str, Convention]:
        return {c.name: c for writer in sorted(WRITERS, key=lambda w: w.rank) for c in writer.conventions}

    def __getitem__(self, name: str) -> Convention:
        return self._all[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._all)

    def __len__(self) -> int:
        return len(self._all)


CONVENTIONS: Mapping[str, Convention] = _Conventions()
