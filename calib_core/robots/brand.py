"""A robot brand: how it writes poses, how its files are known, read and written."""

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from calib_core.messages import message
from calib_core.poses.conventions import Writer
from calib_core.proof import Proof, is_experimental

if TYPE_CHECKING:
    from calib_core.exports.entry import Export
    from calib_core.robots.controller_file import Found, Reference
    from calib_core.robots.file_hints import Told


@cache
def _stands_in(module: str, file: str) -> bool:
    """Return whether a brand's folder has a file: asked for each file of a backup, looked for once."""
    return hasattr(import_module(module), "__path__") and find_spec(f"{module}.{file}") is not None


class Brand(Writer):
    """One brand, in a folder of its own with a constant `BRAND`; a subclass says what it knows.

    Of the folder, `reader.py` with a function `find`, `writer.py` with an `EXPORT` and `check.py` with a `CHECK`
    are found by their names; what there is no file for, the brand cannot do. They are imported when they are
    called for, so that listing the brands stays cheap.

    Attributes
    ----------
    name : str
        As `--brand` and the exports name it.
    title : str
        As a person reads it.
    conventions : tuple of Convention
        How its controllers write a pose; none where it is another brand's.
    writes_like : str
        The convention of its files: its own, or the other brand's that has the same formula.
    endings : tuple of str
        File endings that it may be asked about, with the dot, in lower case.
    marks : str
        A pattern of statements that only this brand's files have, looked for line by line in any case.
    rank : int
        Where its conventions stand in lists: those of no brand and the most common brands first.
    flange, base : frozenset of str
        The tools that are the flange, and the frames that are the base, in lower case.
    definitions : str
        The files that define tools and frames, as a person looks for them.
    frames_settled : bool
        Whether it is known which way round a frame that a file names works.
    points : str
        The files that hold the positions which a program only names.
    proof : Proof
        What proved its reader, and its writer by the same syntax; of programs that move there is none yet.
    """

    title: str
    writes_like: str = ""
    endings: tuple[str, ...] = ()
    marks: str = ""
    flange: frozenset[str] = frozenset({"0"})
    base: frozenset[str] = frozenset({"0"})
    definitions: str = message("the controller's backup")
    frames_settled: bool = True
    points: str = message("the file that holds it")
    proof: Proof = "manual only"

    def recognises(self, text: str, name: str) -> bool:
        """Return whether a file is surely of this brand, by the text in it (unpacked, with plain line ends)."""
        return bool(self.marks) and re.search(self.marks, text, re.MULTILINE | re.IGNORECASE) is not None

    def telling(self, told: "Told") -> "Brand":
        """Return the brand with what the user says about its files; most files say all themselves."""
        return self

    def find(self, data: bytes, name: str) -> "Found":
        """Return what stands in one file, nothing applied yet.

        Raises
        ------
        InputError
            If this brand has no reader, or the file is not one of its files at all.
        """
        if not self._has("reader"):
            from calib_core.errors import InputError

            raise InputError("a file of a brand with a reader", self.title, "Paste the poses' numbers.", name)
        return self._own("reader").find(data, name)

    def together(self, found: "Sequence[Found]") -> "Sequence[Found]":
        """Return what files read together hold, by what one of them says of the others.

        Raises
        ------
        InputError
            If they contradict each other.
        """
        return found

    def doubt(self, what: str, number: "Reference") -> str:
        """Return what is not certain about a tool that is taken for the flange, or a frame taken for the base."""
        return ""

    def exports(self) -> "tuple[Export, ...]":
        """Return what this brand writes: the tool and frame data, and the program that checks them."""
        written = [replace(self._own("writer").EXPORT, proof=self.proof)] if self._has("writer") else []
        return (*written, *([self._own("check").CHECK] if self._has("check") else []))

    @property
    def reads(self) -> bool:
        """Whether files of this brand can be read."""
        return type(self).find is not Brand.find or self._has("reader")

    def describe(self) -> dict[str, Any]:
        """Return the entry as JSON data."""
        return {
            "name": self.name,
            "title": self.title,
            "conventions": [convention.name for convention in self.conventions] or [self.writes_like],
            "endings": list(self.endings),
            "reads": self.reads,
            "exports": [export.name for export in self.exports()],
            "proof": self.proof,
            "experimental": is_experimental(self.proof),
        }

    def _has(self, file: str) -> bool:
        return _stands_in(type(self).__module__, file)

    def _own(self, file: str) -> Any:
        return import_module(f"{type(self).__module__}.{file}")
