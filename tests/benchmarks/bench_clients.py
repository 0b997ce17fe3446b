"""Clients that generators make of our OpenAPI walk through docs/rest.md as they came, in four languages."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
from bench_load import served
from harness import Row

_WALKS = Path(__file__).parent / "clients"
_TSCONFIG = {
    "compilerOptions": {
        "module": "nodenext",
        "target": "es2022",
        "strict": True,
        "skipLibCheck": True,
        "types": ["node"],
    },
    "files": ["walk.ts"],
}
_TOLD_LINES = 4
_JAVA = "library=native,useJakartaEe=true,openApiNullable=false,hideGenerationTimestamp=true"


def run(full: bool) -> Iterator[Row]:
    """Yield a row a language, Python alone without `full`; generators are installed into a temporary folder."""
    walks: dict[str, Callable[[Path, str], None]] = {"openapi-python-client": _python}
    if full:
        walks |= {"openapi-typescript with openapi-fetch": _typescript}
        walks |= {"openapi-generator, Java": _java, "openapi-generator, Go": _go}
    with tempfile.TemporaryDirectory() as temporary, served(Path(temporary) / "data") as (address, _):
        folder = Path(temporary)
        document = httpx.get(f"{address}/openapi.json", trust_env=False, timeout=120).text
        (folder / "openapi.json").write_text(document, encoding="utf-8")
        _do(folder, sys.executable, "-m", "server.cli", "simulate", "tcp", "--seed", "7", "--out", "cell")
        for name, walk in walks.items():
            try:
                walk(folder, address)
            except (subprocess.CalledProcessError, FileNotFoundError) as error:
                yield Row(f"{name}: the walk of docs/rest.md", "no hand edits", _told(error), False)
            else:
                yield Row(f"{name}: the walk of docs/rest.md", "no hand edits", "walked", True)


def _told(error: Exception) -> str:
    """Return what a command says first of what is wrong, else what it said last."""
    lines = (getattr(error, "output", "") or str(error)).strip().splitlines()
    wrong = [line for line in lines if "[ERROR]" in line or "error:" in line.lower()]
    return " ".join(" ".join(wrong[:_TOLD_LINES] or lines[-_TOLD_LINES:]).split())[:400]


def _python(folder: Path, address: str) -> None:
    python = _environment(folder, "openapi-python-client")
    generate = [str(python.parent / "openapi-python-client"), "generate", "--path", "openapi.json"]
    _do(folder, *generate, "--output-path", "pyclient", "--meta", "none")
    shutil.copy(_WALKS / "walk.py", folder)
    _do(folder, str(python), "walk.py", address, "cell")


def _typescript(folder: Path, address: str) -> None:
    (folder / "package.json").write_text('{"type": "module"}')
    (folder / "tsconfig.json").write_text(json.dumps(_TSCONFIG))
    _do(folder, "npm", "install", "openapi-typescript@7", "openapi-fetch", "typescript@5", "@types/node")
    _do(folder, "npx", "openapi-typescript", "openapi.json", "-o", "api.d.ts")
    shutil.copy(_WALKS / "walk.ts", folder)
    _do(folder, "npx", "tsc", "-p", ".")
    _do(folder, "node", "walk.js", address, "cell")


def _java(folder: Path, address: str) -> None:
    python = _environment(folder, "openapi-generator-cli")
    generate = [str(python.parent / "openapi-generator-cli"), "generate", "-i", "openapi.json", "-g", "java"]
    _do(folder, *generate, "-o", "java", f"--additional-properties={_JAVA}")
    sources = folder / "java" / "src" / "main" / "java"
    shutil.copy(_WALKS / "Walk.java", sources)
    maven = ["mvn", "-q", "-B", "-f", "java/pom.xml", "-Dmaven.test.skip=true"]
    _do(folder, *maven, "compile", "dependency:copy-dependencies")
    classes = "java/target/classes:java/target/dependency/*"
    _do(folder, "java", "-cp", classes, "Walk", address, "cell")


def _go(folder: Path, address: str) -> None:
    python = _environment(folder, "openapi-generator-cli")
    generate = [str(python.parent / "openapi-generator-cli"), "generate", "-i", "openapi.json", "-g", "go"]
    _do(folder, *generate, "-o", "go", "--additional-properties=packageName=scancell,withGoMod=true")
    shutil.rmtree(folder / "go" / "test", ignore_errors=True)  # its tests ask for a library of their own
    (folder / "go" / "walk").mkdir()
    shutil.copy(_WALKS / "walk.go", folder / "go" / "walk" / "main.go")
    _do(folder / "go", "go", "mod", "tidy")
    _do(folder / "go", "go", "run", "./walk", address, str(folder / "cell"))


def _environment(folder: Path, package: str) -> Path:
    python = folder / package / "bin" / "python"
    if python.exists():
        return python
    _do(folder, sys.executable, "-m", "venv", package)
    _do(folder, str(python), "-m", "pip", "install", "-q", package, "ruff")
    return python


def _do(folder: Path, *words: str) -> None:
    """Run a command; what it says comes with the error where it fails."""
    root = str(Path(__file__).resolve().parents[2])
    environment = {**_outside(), "PYTHONPATH": root} if "server.cli" in words else _outside()
    subprocess.run(
        words, cwd=folder, env=environment, check=True, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )


def _outside() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
