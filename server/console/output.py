"""What a command prints: its result for people or programs, and remarks beside it."""

import argparse
import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

STANDARD_OUTPUT = Path("-")


def print_result(options: argparse.Namespace, text: str, data: Any) -> None:
    """Print what a command found: one JSON object with --json, else text; nothing with --quiet alone."""
    if options.json:
        print(json.dumps(data, ensure_ascii=False, allow_nan=False), flush=True)
    elif not options.quiet:
        print(text, flush=True)


def remark(options: argparse.Namespace, sentence: str) -> None:
    """Say something on standard error, unless --quiet."""
    if not options.quiet:
        print(f"scancell: {sentence}", file=sys.stderr)


def write_out(options: argparse.Namespace, out: Path, pieces: Iterable[bytes | memoryview]) -> None:
    """Write a command's file to where --out says: a file, whole or not at all; `-`; a pipe.

    Raises
    ------
    InputError
        If it cannot be written there; or `-` is a terminal that cannot show it, or wanted for JSON.
    """
    from calib_core.errors import InputError
    from calib_core.formats.shared.writing import write_pieces

    if out != STANDARD_OUTPUT:
        write_pieces(out, pieces)
        print_result(options, str(out), {"file": str(out)})
        return
    if options.json:
        raise InputError("a file beside --json", "standard output for both", "Add --out FILE.", "--out")
    for piece in pieces:
        sys.stdout.buffer.write(piece)
    sys.stdout.buffer.flush()
