"""Poses of no brand: tables with named columns, matrices as bare numbers and in OpenCV's YAML."""

import re
from typing import TYPE_CHECKING

from calib_core.robots.brand import Brand
from calib_core.robots.file_hints import NOTHING_TOLD, Told

if TYPE_CHECKING:
    from calib_core.robots.controller_file import Found


class Table(Brand):
    """Tables and OpenCV's files."""

    name = "table"
    title = "Table or OpenCV file"
    proof = "real files"
    writes_like = "matrix"
    endings = (".csv", ".tsv", ".txt", ".yaml", ".yml", ".xml")
    rank = 2000
    base = frozenset({"0", "base"})
    flange = frozenset({"0", "tool0"})
    told: Told = NOTHING_TOLD

    def recognises(self, text: str, name: str) -> bool:
        """Return whether it is OpenCV's, a table whose header names the numbers of a pose, or of matrices."""
        if text.startswith("%YAML:1.0") or "<opencv_storage>" in text[:200]:
            return True
        from calib_core.robots.table.columns import roles_of

        head = next((line for line in text.split("\n", 40)[:40] if line.strip() and line.strip()[0] != "#"), "")
        if "actual_TCP_pose_0" not in head and roles_of(re.split(r"[;\t]|,\s*|\s+", head.strip())):
            return True
        from calib_core.robots.table.matrices import are_matrices

        return are_matrices(text)

    def telling(self, told: Told) -> "Table":
        """Return the brand with what the user says about its files."""
        chosen = Table()
        chosen.told = told
        return chosen

    def find(self, data: bytes, name: str) -> "Found":
        """Return the poses of a table or of OpenCV's matrices."""
        if data.lstrip(b"\xef\xbb\xbf").startswith((b"%YAML:1.0", b"<?xml")):
            from calib_core.robots.table.opencv import find

            return find(data, name, self.told)
        from calib_core.robots.table import matrices, reader
        from calib_core.robots.text import decoded

        text = decoded(data)
        told_otherwise = self.told.columns or self.told.convention not in (None, "matrix")
        if not told_otherwise and matrices.are_matrices(text):
            return matrices.find(text, name, self.told.unit)
        return reader.find(data, name, self.told)


BRAND = Table()
