"""What solvers call: to read a capture's file, to tell how far they are, to store what they make."""

from collections.abc import Callable, Iterable

ReadFile = Callable[[str], bytes]
"""Returns a file's bytes by its name in a capture."""

Progress = Callable[[float, str], None]
"""Takes the fraction done, and what is being done."""

StoreFile = Callable[[str, Iterable[bytes | memoryview]], object]
"""Takes a file that a stage makes beside its result, by name and in pieces."""
