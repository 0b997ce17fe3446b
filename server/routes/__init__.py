"""The REST routes: parse, call, store; every router of a file here is served."""

from collections.abc import Iterator
from importlib import import_module
from pkgutil import iter_modules

from fastapi import APIRouter


def all_routers() -> Iterator[APIRouter]:
    """Give the routers of this folder, file by file."""
    for file in iter_modules(__path__, f"{__name__}."):
        yield from (one for one in vars(import_module(file.name)).values() if isinstance(one, APIRouter))
