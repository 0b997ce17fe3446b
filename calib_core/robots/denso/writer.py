"""Denso: the lines of a program that set tool and user frame; those lines of a program."""

from calib_core.exports.numbered_statements import Statements

EXPORT = Statements("Tool", "Work", "P", "P?", "yaskawa").export(
    "denso", "Denso: Tool and Work (PacScript)", ".pcs"
)
