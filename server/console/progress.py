"""A bar on standard error where that is a terminal, and silence elsewhere."""

import argparse
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager, nullcontext

from calib_core.compiled import on_compiling
from server.console.output import remark


@contextmanager
def progress_bar(options: argparse.Namespace, says_why: bool = True) -> Generator[Callable[[float, str], None]]:
    """Give a function that shows the fraction done and what is being done; say why where kernels are compiled."""
    with _told_of_compiling(options) if says_why else nullcontext():
        if options.quiet or not sys.stderr.isatty():
            yield lambda _fraction, _message: None
        else:
            yield from _bar()


def _bar() -> Generator[Callable[[float, str], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (BarColumn(bar_width=24), TextColumn("{task.description}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda fraction, message: bar.update(task, completed=fraction, description=message)


@contextmanager
def _told_of_compiling(options: argparse.Namespace) -> Generator[None]:
    """Say once why a first run takes longer, where kernels are compiled in it."""

    def tell() -> None:
        on_compiling.remove(tell)
        remark(
            options,
            "compiling the numerical kernels, up to a minute and this once; `scancell warm` does it beforehand.",
        )

    on_compiling.append(tell)
    try:
        yield
    finally:
        if tell in on_compiling:
            on_compiling.remove(tell)
