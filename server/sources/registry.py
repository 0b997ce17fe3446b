"""The list of sources: those of this package, and those that other packages bring."""

from calib_core.registry import Registry
from server.sources.source import Source

SOURCES = Registry("a source of captures", "server.sources", "SOURCE", Source, "scancell.sources")
