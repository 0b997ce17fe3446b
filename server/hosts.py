"""Names and addresses of computers, as settings hold them."""

import re
from typing import Annotated

from pydantic import AfterValidator


def _host(text: str) -> str:
    """Return it; raises ValueError where no resolver would take it: it would fail only when it is connected to."""
    if not re.fullmatch(r"[\w.:%-]+", text):
        raise ValueError("need a host's name or address, such as 192.168.0.5")
    text.encode("idna")
    return text


HostName = Annotated[str, AfterValidator(_host)]
"""A computer's name or address."""
