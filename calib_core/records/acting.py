"""Who acted, as it is said: names stand as they are in every language."""

from typing import Final

from calib_core.messages import message

THIS_MACHINE: Final = "this machine"
"""The name that is kept where nobody has to log in."""


def said_who(who: str | None) -> str:
    """Return who acted; somebody without a name, or nobody who is known, in the language of whoever reads it."""
    if not who:
        return message("nobody known")
    return message("this machine") if who == THIS_MACHINE else who
