"""What proved a reader or writer of foreign files: shown wherever one is chosen or downloaded."""

from typing import Final, Literal

from calib_core.messages import Message, message

Proof = Literal["controller", "real files", "manual only"]
"""A controller took or gave its files; files of real controllers, scanners or programs; at best its manual."""

WORDS: Final[dict[Proof, Message]] = {
    "controller": message("proved on a controller"),
    "real files": message("proved by real files"),
    "manual only": message("experimental: no controller and no real file has proved it"),
}


def is_experimental(proof: Proof | None) -> bool:
    """Return whether at best a manual stands behind it; what is the project's own needs no proof."""
    return proof == "manual only"
