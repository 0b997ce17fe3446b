"""Content security policies: what a page of ours may load and run; nothing of it ever comes from elsewhere."""

_PAGE = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "style-src-attr 'unsafe-inline'",  # widths and places in plots
        "img-src 'self' data: blob:",
        "connect-src 'self'",
        "frame-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'self'",
    )
)
# The documentation page starts itself by an inline script and styles itself.
_DOCS = _PAGE.replace("script-src 'self'", "script-src 'self' 'unsafe-inline'").replace(
    "style-src 'self'", "style-src 'self' 'unsafe-inline'"
)
# One file that carries its own style and pictures, and runs nothing.
_REPORT = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; " + (
    "frame-ancestors 'self'"
)
_DATA = "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"


def policy_for(path: str) -> str:
    """Return the policy of an answer that does not bring its own."""
    if path == "/docs":
        return _DOCS
    if path.startswith("/api/"):
        return _REPORT if path.endswith("/report") else _DATA
    return _PAGE
