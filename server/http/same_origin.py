"""Which page a request comes from, and whether that matters for it."""

from urllib.parse import urlsplit

from starlette.types import Scope

_SAFE_METHODS = ("GET", "HEAD", "OPTIONS")
_DEFAULT_PORTS = {"http": ":80", "https": ":443"}


def is_safe(scope: Scope) -> bool:
    """Return whether a request changes nothing, and tells its answer to nobody but a page of this server."""
    return scope["type"] == "http" and scope["method"] in _SAFE_METHODS


def is_same_origin(origin: str | None, host: str | None) -> bool:
    """Tell whether a request comes from a page of this very server: Origin's host and port are those of Host."""
    if not origin or not host:
        return False
    parts = urlsplit(origin)
    if parts.scheme not in _DEFAULT_PORTS:
        return False
    default = _DEFAULT_PORTS[parts.scheme]
    return parts.netloc.lower().removesuffix(default) == host.lower().removesuffix(default)
