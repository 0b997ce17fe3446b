"""The rooms stand in one order: each imports only rooms listed before it, also for types and within functions."""

import ast
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.core.test_import_rules import ROOT, imports, in_circles, is_module

CORE = (
    "messages", "counted", "errors", "disk", "windows_runtime", "moment", "compiled", "lean_open3d", "registry",
    "steps", "proof",
    "frames", "frame_graph", "pose_track", "clock_offset", "kernels", "estimation",
    "poses", "records", "findings", "simulation", "evidence",
    "formats", "sphere", "optics", "fusion", "arms", "cell", "chain",
    "graph", "captures", "guidance", "causes",
    "archive", "exports", "robots", "stages", "review", "recognition", "library",
)  # fmt: skip
"""From the ground up; `docs/architecture.md` says what each is for."""

SERVER = (
    "heap", "hosts", "background", "windows_service", "measuring", "simulated_cell", "settings",
    "store", "metrics", "health", "webhooks", "page_questions", "console", "housekeeping", "render",
    "http", "auth", "logs", "jobs", "scenes", "guides", "captures", "sources", "movers", "live",
    "routes", "app", "serve", "commands", "cli",
)  # fmt: skip

ORDERS = {"calib_core": CORE, "server": SERVER}


@cache
def files_of(top: str) -> dict[str, Path]:
    """Return a package's files by the names of their modules, the package itself left out."""
    files = (ROOT / top).rglob("*.py")
    names = {".".join(f.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): f for f in files}
    return {name: file for name, file in names.items() if name != top}


def imported(file: Path, modules: Iterable[str]) -> Iterator[str]:
    """Give the modules that a file imports wherever in it, those for types too."""
    for module, name, _ in imports(file):
        found = f"{module}.{name}" if is_module(f"{module}.{name}") else module
        if found in modules:
            yield found


def room_of(module: str) -> str:
    return module.split(".")[1]


@pytest.mark.parametrize("top", ORDERS)
def test_every_room_has_its_place(top: str) -> None:
    assert sorted({room_of(name) for name in files_of(top)}) == sorted(ORDERS[top])


@pytest.mark.parametrize("top", ORDERS)
def test_a_room_imports_only_rooms_listed_before_it(top: str) -> None:
    modules, place = files_of(top), {room: k for k, room in enumerate(ORDERS[top])}
    upwards = [
        f"{name} imports {found}"
        for name, file in modules.items()
        for found in imported(file, modules)
        if place[room_of(found)] > place[room_of(name)]
    ]
    assert upwards == []


@pytest.mark.parametrize("top", ORDERS)
def test_no_file_stands_in_a_circle_even_for_types(top: str) -> None:
    modules = files_of(top)
    assert in_circles({name: set(imported(file, modules)) for name, file in modules.items()}) == set()


@pytest.mark.parametrize("top", ORDERS)
def test_every_folder_says_in_one_line_what_it_is_for(top: str) -> None:
    folders = {file.parent for file in files_of(top).values() if "migrations" not in file.parts}
    purposes: dict[str, Path] = {}
    for folder in folders:
        text = ast.get_docstring(ast.parse((folder / "__init__.py").read_text(encoding="utf-8"))) or ""
        line = text.partition("\n")[0]
        assert line.endswith("."), folder
        assert purposes.setdefault(line, folder) == folder
    assert len(purposes) == len(folders) > 20
