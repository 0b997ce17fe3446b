"""Epson: the lines of a program that set tool and user frame; those lines of a program."""

from calib_core.exports.numbered_statements import Statements

EXPORT = Statements("TLSet", "Local", "XY", "XY", "nachi").export(
    "epson", "Epson: TLSet and Local (SPEL+)", ".prg"
)
