"""Arrows run one way: web → HTTP → server → calib_core.  Read from the sources, so that no late import hides."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TOPS = ("calib_core", "scancell_client", "server")
SOURCES = sorted(file for top in TOPS for file in (ROOT / top).rglob("*.py"))
WEB_AND_STORE = {
    "server", "fastapi", "starlette", "uvicorn", "viser", "sqlalchemy", "alembic", "websockets", "httpx",
    "multipart", "pydantic_settings", "scancell_client",
}  # fmt: skip
FILES = {"pathlib", "os", "shutil", "tempfile", "glob", "zipfile", "tarfile", "fileinput", "subprocess", "socket"}
FILE_ROOMS = (
    "calib_core/archive/", "calib_core/captures/", "calib_core/compiled.py", "calib_core/formats/",
    "calib_core/library/", "calib_core/findings/catalogues.py", "calib_core/disk.py",
)  # fmt: skip
PURE_PATHS = {"PurePath", "PurePosixPath", "PureWindowsPath"}
FILE_METHODS = {"read_text", "write_text", "read_bytes", "write_bytes", "tofile", "unlink", "mkdir"}
Import = tuple[str, str, int]
FILE_FUNCTIONS = {"loadtxt", "genfromtxt", "savetxt", "save", "savez", "fromfile", "imread", "imwrite", "memmap"}


@cache
def read(file: Path) -> tuple[tuple[Import, ...], tuple[str, ...], frozenset[int]]:
    """Return a file's imports, its calls that touch files, and the lines for types alone; not its syntax tree."""
    nodes = list(ast.walk(ast.parse(file.read_text(encoding="utf-8"))))
    calls = (node for node in nodes if isinstance(node, ast.Call))
    return (
        tuple(found for node in nodes for found in imported(file, node)),
        tuple(f"line {call.lineno}: {name}" for call in calls if (name := touching(call))),
        frozenset(line for node in nodes if isinstance(node, ast.If) for line in lines_for_types(node)),
    )


def lines_for_types(node: ast.If) -> range:
    if not (isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"):
        return range(0)
    return range(node.lineno, (node.body[-1].end_lineno or node.lineno) + 1)


def imported(file: Path, node: ast.AST) -> Iterator[Import]:
    if isinstance(node, ast.Import):
        yield from ((alias.name, "", node.lineno) for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        # The client stands in its own wheel, and as a copy in the server's.
        client = file.parent.name == "scancell_client" and node.level == 1
        assert client or node.level == 0, f"{file}:{node.lineno}: name the package in full"
        module = f"scancell_client.{node.module}" if client else node.module or ""
        yield from ((module, alias.name, node.lineno) for alias in node.names)


def touching(call: ast.Call) -> str:
    """Return how a call touches files, nothing where it does not."""
    called = call.func
    if isinstance(called, ast.Name) and called.id == "open":
        return "open()"
    if isinstance(called, ast.Attribute):
        module = called.value.id if isinstance(called.value, ast.Name) else ""
        if called.attr in FILE_METHODS or (module in ("np", "cv2", "io") and called.attr in FILE_FUNCTIONS):
            return f".{called.attr}()"
    return ""


def imports(file: Path) -> tuple[Import, ...]:
    """Return every import as module, name (or nothing) and line, also those within functions."""
    return read(file)[0]


def within(module: str, *packages: str) -> bool:
    return any(module == package or module.startswith(package + ".") for package in packages)


def name_of(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


def test_the_rules_see_the_sources() -> None:
    names = {name_of(file) for file in SOURCES}
    assert {"calib_core/frames.py", "calib_core/archive/folder.py", "server/cli.py"} <= names
    found = {module for module, _, _ in imports(ROOT / "calib_core" / "frames.py")}
    assert {"numpy", "calib_core.errors", "scipy.spatial.transform"} <= found  # the last within a function


def test_calib_core_knows_no_server_web_or_store() -> None:
    core = [f for f in SOURCES if name_of(f).startswith("calib_core/")]
    assert len(core) > 100
    wrong = [(name_of(f), m) for f in core for m, _, _ in imports(f) if m.partition(".")[0] in WEB_AND_STORE]
    assert wrong == []


def test_the_client_knows_neither_core_nor_server() -> None:
    client = [f for f in SOURCES if name_of(f).startswith("scancell_client/")]
    assert len(client) > 4
    found = {m.partition(".")[0] for f in client for m, _, _ in imports(f)}
    assert found - set(sys.stdlib_module_names) == {"httpx", "pydantic", "scancell_client"}


def touches_files(file: Path) -> list[str]:
    found = [
        f"line {line}: import of {module}.{name}"
        for module, name, line in imports(file)
        if module.partition(".")[0] in FILES and not (module == "pathlib" and name in PURE_PATHS)
    ]
    return [*found, *read(file)[1]]


def test_only_archive_captures_and_formats_touch_files() -> None:
    found = {
        name_of(file): touched
        for file in SOURCES
        if within(name_of(file), "calib_core") or name_of(file).startswith("calib_core/")
        if not name_of(file).startswith(FILE_ROOMS) and (touched := touches_files(file))
    }
    assert found == {}
    assert touches_files(ROOT / "calib_core" / "archive" / "folder.py")  # the rule does see what it forbids


def test_only_scenes_import_viser() -> None:
    importers = {name_of(f) for f in SOURCES for m, _, _ in imports(f) if within(m, "viser")}
    assert importers
    assert all(name.startswith("server/scenes/") for name in importers), importers


def test_the_simulator_shares_no_code_with_the_solvers() -> None:
    solvers = [
        f"calib_core.{p}" for p in ("frames", "chain", "sphere", "optics", "kernels", "fusion", "estimation")
    ]
    of_tests = [*(ROOT / "tests" / "trouble").glob("*.py"), *(ROOT / "tests").glob("*bound.py")]
    of_tests += [ROOT / "tests" / f"{name}.py" for name in ("arm_cell", "fixed_board_cell", "planned", "shapes")]
    files = [*(f for f in SOURCES if name_of(f).startswith("calib_core/simulation/")), *of_tests]
    assert len(of_tests) > 9
    wrong = [
        (name_of(f), m)
        for f in files
        for m, n, _ in imports(f)
        if within(m, *solvers) or within(f"{m}.{n}", *solvers)
    ]
    assert wrong == []


def test_simulated_devices_share_no_mathematics_with_the_solvers() -> None:
    """Their arm tells joints that the solvers' arms check: by one table both would be wrong alike."""
    solvers = [f"calib_core.{p}" for p in ("arms", "chain", "sphere", "optics", "kernels", "fusion", "estimation")]
    files = [f for f in SOURCES if name_of(f).startswith("server/simulated_cell/")]
    assert len(files) > 5
    assert [(name_of(f), m) for f in files for m, _, _ in imports(f) if within(m, *solvers)] == []


def test_no_solver_imports_the_simulator_or_the_session() -> None:
    """A step is a function of what it is given: who reads the session calls it, not the other way round."""
    places = ("chain", "sphere", "optics", "kernels", "fusion", "robots")
    above = tuple(f"calib_core.{room}" for room in ("archive", "captures", "stages", "review", "simulation"))
    files = [f for f in SOURCES if name_of(f).split("/")[1] in places]
    assert len(files) > 20
    assert [(name_of(f), m) for f in files for m, _, _ in imports(f) if within(m, *above)] == []


def test_kernels_rest_on_numpy_and_numba() -> None:
    files = (ROOT / "calib_core" / "kernels").glob("*.py")
    used = {m.partition(".")[0] if not within(m, "calib_core") else m for f in files for m, _, _ in imports(f)}
    own = {m for m in used if within(m, "calib_core")}
    assert used - own - sys.stdlib_module_names == {"numpy", "numba"}
    assert all(within(m, "calib_core.kernels", "calib_core.frames", "calib_core.compiled") for m in own), own


def test_nothing_imports_the_page_and_the_product_not_its_tests() -> None:
    wrong = [
        (name_of(f), m)
        for f in SOURCES
        for m, _, _ in imports(f)
        if within(m, "web", "tests", "pytest", "hypothesis")
    ]
    assert wrong == []


def imported_to_run(file: Path) -> Iterator[str]:
    """Give what a module imports as it is loaded or within functions, not for types alone."""
    module_imports, _, for_types = read(file)
    for module, name, line in module_imports:
        if line not in for_types:
            yield f"{module}.{name}" if is_module(f"{module}.{name}") else module


@cache
def is_module(name: str) -> bool:
    path = ROOT / name.replace(".", "/")
    return path.with_suffix(".py").is_file() or (path / "__init__.py").is_file()


def page_imports(file: Path) -> Iterator[str]:
    for path in re.findall(
        r'^(?:import|export)\b[^;"]*"(\.[^"]+)"', file.read_text(encoding="utf-8"), re.MULTILINE
    ):
        yield str((file.parent / path).resolve())


def in_circles(graph: dict[str, set[str]]) -> set[str]:
    """Return the nodes that are left when those that lead to nothing are taken away, again and again."""
    left = {node: set(after) & graph.keys() - {node} for node, after in graph.items()}
    while ends := {node for node, after in left.items() if not after}:
        left = {node: after - ends for node, after in left.items() if node not in ends}
    return set(left)


def test_nothing_is_imported_in_a_circle() -> None:
    names = {name_of(f).removesuffix(".py").removesuffix("/__init__").replace("/", "."): f for f in SOURCES}
    assert in_circles({name: set(imported_to_run(f)) for name, f in names.items()}) == set()
    page = [f for f in (ROOT / "web").rglob("*.js") if "vendor" not in f.parts]
    assert len(page) > 100
    assert in_circles({str(f): set(page_imports(f)) for f in page}) == set()
    assert in_circles({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == {"a", "b", "c"}


HEAVY = ("numba", "cv2", "open3d", "viser", "fastapi", "sqlalchemy", "uvicorn", "scipy.optimize", "scipy.stats")


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("server.cli", (*HEAVY, "numpy", "pydantic")),  # --help is printed by this alone
        ("calib_core.records", (*HEAVY, "scipy")),
        ("calib_core.stages.pipeline", HEAVY),
        ("calib_core.chain.tcp", HEAVY),
        ("server.serve", ("numba", "cv2", "open3d", "viser", "scipy.stats")),
    ],
)
def test_heavy_modules_are_imported_late(module: str, heavy: tuple[str, ...]) -> None:
    code = f"import sys, {module}; print(*(name for name in {heavy!r} if name in sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, timeout=60, check=True
    )
    assert done.stdout.split() == []
