"""Where the compiled kernels are kept, for which processor, when they are compiled anew, and who is told of it.

numba keeps the machine code of a kernel under the hash of its own file.  The code of kernels that it calls is
linked into it, so a change of theirs would leave it stale; here the hash covers what a kernel imports too.

An image, a portable zip or a wheel may bring kernels for any x86-64 processor of the last ten years (`BASELINE`).
A process takes them until all are there for the machine's own, which are compiled beside and faster.  Where the
package may not be written, as one that an administrator installed, both are kept in the user's cache folder.
Imported alone this module brings no numba.
"""

import hashlib
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Literal

KERNELS = Path(__file__).resolve().parent / "kernels"
_BESIDE = KERNELS / "__pycache__"
_IMPORT = re.compile(r"^from calib_core\.kernels\.(\w+) import", re.MULTILINE)

BASELINE = "x86-64-v3"
"""What kernels that are brought along are compiled for: its instructions are those of Haswell and Zen."""
_BASELINE_FEATURES = ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")

on_compiling: list[Callable[[], object]] = []
"""Called before a kernel is compiled, in the thread that waits for it."""


def set_up() -> None:
    """Make numba keep kernels under the hash of all that they are made of, and tell of compiling; idempotent."""
    from calib_core.windows_runtime import require_runtime

    require_runtime()
    from numba.core import config, event
    from numba.core.caching import CacheImpl

    places = CacheImpl._locator_classes  # pyright: ignore[reportPrivateUsage]
    if places[0].__name__.startswith("_Kernels"):
        return
    places[:0] = _places()
    take_brought_along(config)

    class Tell(event.Listener):
        def on_start(self, event: Any) -> None:
            if Path(event.data["dispatcher"].py_func.__code__.co_filename).parent == KERNELS:
                for told in tuple(on_compiling):
                    told()

        def on_end(self, event: Any) -> None:
            pass

    event.register("numba:compile", Tell())


def compile_for(processor: Literal["own", "baseline"]) -> None:
    """Compile for the machine's own processor, or any, whatever is there already: before kernels are imported."""
    global _asked
    _asked = processor


_asked: Literal["own", "baseline"] | None = None


def take_brought_along(config: Any) -> None:
    """Have numba load and compile for any processor where asked to, or where its own kernels are not ready."""
    if config.CPU_NAME is not None:  # NUMBA_CPU_NAME
        return
    if _asked == "baseline" or (_asked is None and not _noted(None) and _noted(BASELINE) and _has_baseline()):
        config.CPU_NAME, config.CPU_FEATURES = BASELINE, ""


def _has_baseline() -> bool:
    import llvmlite.binding

    features = llvmlite.binding.get_host_cpu_features()
    return all(features.get(name) for name in _BASELINE_FEATURES)


def all_are_compiled() -> bool:
    """Return whether a process that asks for nothing else finds all kernels, its own or those brought along."""
    return _noted(None) or (_noted(BASELINE) and _has_baseline())


def own_are_compiled() -> bool:
    """Return whether all kernels are there for this machine's processor."""
    return _noted(None)


def _noted(processor: str | None) -> bool:
    return any(file.exists() for file in stamp_files(processor))


def note_that_all_are_compiled(processor: str | None = None) -> None:
    """Leave word for later starts, in the first place that may be written."""
    for file in stamp_files(processor):
        with suppress(OSError):
            file.parent.mkdir(parents=True, exist_ok=True)
            file.touch()
            return


def stamp_files(processor: str | None = None) -> list[Path]:
    """Return the files of which one says that all kernels are there for a processor."""
    import llvmlite.binding
    import numba
    from numba.core.caching import UserWideCacheLocator

    digest = hashlib.sha256()
    for source in sorted(KERNELS.glob("*.py")):
        digest.update(source.read_bytes())
    processor = processor or llvmlite.binding.get_host_cpu_name()
    digest.update(f"{numba.__version__} {sys.version_info[:2]} {sys.platform} {processor}".encode())
    place = os.environ.get("NUMBA_CACHE_DIR")
    of_user = UserWideCacheLocator(stamp_files, str(KERNELS / "__init__.py")).get_cache_path()
    folders = [Path(place)] if place else [_BESIDE, Path(of_user)]
    return [folder / f"all-{digest.hexdigest()[:16]}.compiled" for folder in folders]


def _places() -> list[Any]:
    """Return numba's own places in their order, for our kernels alone, and one for where none may be written."""
    from numba.core import caching

    class Ours:
        _py_file: str

        @classmethod
        def from_function(cls, py_func: Any, py_file: str) -> Any:
            return super().from_function(py_func, py_file) if Path(py_file).parent == KERNELS else None  # type: ignore[misc]

        def get_source_stamp(self) -> bytes:
            return source_hash(Path(self._py_file).stem)

    class _KernelsWhereAsked(Ours, caching.UserProvidedCacheLocator):
        """NUMBA_CACHE_DIR."""

    class _KernelsBesideSources(Ours, caching.InTreeCacheLocator):
        """The package's `__pycache__`."""

    class _KernelsOfUser(Ours, caching.UserWideCacheLocator):
        """The user's cache folder, where the package may not be written; what it brings is taken along."""

        @classmethod
        def from_function(cls, py_func: Any, py_file: str) -> Any:
            found = super().from_function(py_func, py_file)
            if found is not None:
                _take_along(Path(found.get_cache_path()))
            return found

    class _KernelsOfProcess(Ours, caching.InTreeCacheLocator):
        """A folder that lasts as long as the process."""

        def get_cache_path(self) -> str:
            return _folder_of_process().name

    return [_KernelsWhereAsked, _KernelsBesideSources, _KernelsOfUser, _KernelsOfProcess]


@cache
def _take_along(folder: Path) -> None:
    """Copy what lies beside the package's sources and is not there yet; an index comes after what it names."""
    from calib_core.disk import replace_file

    for file in sorted(_BESIDE.glob("*.nb[ci]")):
        target, fresh = folder / file.name, folder / f"{file.name}.{os.getpid()}"
        if not target.exists():
            with suppress(OSError):
                shutil.copyfile(file, fresh)
                replace_file(fresh, target)


@cache
def _folder_of_process() -> "tempfile.TemporaryDirectory[str]":
    return tempfile.TemporaryDirectory(prefix="scancell-kernels-", ignore_cleanup_errors=True)


@cache
def source_hash(module: str) -> bytes:
    """Return the SHA-256 of a module of the kernels and of all of them that it imports."""
    seen: dict[str, bytes] = {}
    todo = [module]
    while todo:
        name = todo.pop()
        if name not in seen:
            seen[name] = (KERNELS / f"{name}.py").read_bytes()
            todo += _IMPORT.findall(seen[name].decode())
    if len(seen) == 1:
        return hashlib.sha256(seen[module]).digest()  # numba's own stamp
    digest = hashlib.sha256()
    for name in sorted(seen):
        digest.update(hashlib.sha256(seen[name]).digest())
    return digest.digest()
