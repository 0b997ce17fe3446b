"""What a text must look like, in words: patterns are for programs, nobody is shown one."""

from typing import Final

from calib_core.messages import message, templates

_WORDS: Final = templates(
    {
        r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$": "up to 64 letters, digits, '.', '_' or '-', no sign first",
        r"^[A-Za-z0-9._-]{1,40}$": "up to 40 letters, digits, '.', '_' or '-'",
        r"^[A-Za-z0-9_ -]{1,80}$": "up to 80 letters, digits, blanks, '_' or '-'",
        r"^[A-Za-z0-9]{8,64}$": "8 to 64 letters or digits",
        r"^\w{1,32}$": "up to 32 letters, digits or '_'",
        r"^[A-Za-z_]\w{0,31}(\[\d{1,4}\])?$": "a name of letters, digits and '_', such as tScanner or tTool[1]",
        r"^[A-Za-z_][\w.]{0,31}(\[\d{1,4}\])?$": "a name of letters, digits, '_' and '.', such as grip.1",
        r"^[A-Za-z0-9.:-]{1,64}$": "a host's name or address",
        r"^https?://\S+$": "an address that begins with http:// or https://",
        r"^wss?://\S+$": "an address that begins with ws:// or wss://",
        r"^opc\.tcp://\S+$": "an address that begins with opc.tcp://",
        r"^\.[A-Za-z0-9]{1,8}$": "an ending such as .csv",
        r"^E[1-6]$": "an external axis, E1 to E6",
        r"^\d{1,15}$": "a number of up to 15 digits",
        r"^[0-9a-f]{64}$": "64 hexadecimal digits",
        r"^\d{4}-[01]\d-[0-3]\dT[0-2]\d:[0-5]\d:[0-5]\d\.\d{3}Z$": "a moment such as 2026-01-31T12:00:00.000Z",
    }
)
OTHER: Final = message("a text of another form")
"""For a pattern that another package brings."""


def in_words(pattern: str) -> str:
    """Return what a text must look like that a pattern describes."""
    return _WORDS.get(pattern, OTHER)
