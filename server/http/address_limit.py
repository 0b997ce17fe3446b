"""How many connections one address may hold, so that one that opens hundreds shuts nobody else out."""

import ipaddress
import math
from collections.abc import Iterable, Sequence
from time import monotonic
from typing import Any, Final, Protocol

_SETTLES_S: Final = 1.0
"""So long a connection is let be to say what it came for, and to read a refusal."""


class Connection(Protocol):
    """One connection: since when it is open, who opened it, and whether it rests or waits for a request's head."""

    opened_s: float
    client: tuple[str, int] | None

    @property
    def waits(self) -> bool:
        """Whether it is open, and no request is being answered."""
        ...

    def hang_up(self) -> None:
        """Close it."""


class AddressLimit:
    """Keeps room for others.

    Parameters
    ----------
    most : int
        Connections that one address may hold.
    proxies : sequence of str
        Addresses and networks that many come from: they have no limit.
    """

    def __init__(self, most: int, proxies: Sequence[str] = ()) -> None:
        self._most = most
        self._proxies = proxies

    def make_room(self, newcomer: Connection, connections: Iterable[Any]) -> None:
        """Close as many of the newcomer's address that wait as are too many, the oldest first.

        Those that have just come are let be until there are twice as many as may be: else a burst would close one
        that asks for health before it was heard.
        """
        same = self._others_of_address(newcomer, connections)
        too_many = len(same) + 1 - self._most
        settled_s = monotonic() - _SETTLES_S if too_many <= self._most else math.inf
        settled = [one for one in same if getattr(one, "waits", False) and one.opened_s < settled_s]
        for one in sorted(settled, key=lambda one: one.opened_s)[: max(0, too_many)]:
            one.hang_up()

    def has_room(self, connection: Connection, connections: Iterable[Any]) -> bool:
        """Whether a request of a connection may be answered: not where all its address may hold are busy."""
        same = self._others_of_address(connection, connections)
        return len(same) < self._most or sum(not getattr(one, "waits", False) for one in same) < self._most

    def _others_of_address(self, connection: Connection, connections: Iterable[Any]) -> list[Any]:
        """Return the open ones of its address, none where that is a proxy's."""
        address = None if connection.client is None else connection.client[0]
        if address is None or self._is_proxy(address):
            return []
        others = [one for one in connections if one is not connection and getattr(one, "client", None)]
        return [one for one in others if one.client[0] == address and getattr(one, "is_open", True)]

    def _is_proxy(self, address: str) -> bool:
        if "*" in self._proxies or address in self._proxies:
            return True
        networks = [ipaddress.ip_network(one, strict=False) for one in self._proxies if "/" in one]
        return any(ipaddress.ip_address(address) in network for network in networks)
