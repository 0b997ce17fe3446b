"""How many connections one address may hold, so that one that opens hundreds shuts nobody else out."""

import ipaddress
from collections.abc import Iterable, Sequence
from typing import Any, Protocol


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

    def makes_room(self, newcomer: Connection, connections: Iterable[Any]) -> bool:
        """Close the oldest connection of the newcomer's address that waits, where there are too many.

        Returns whether there is room for the newcomer: all others may be busy.
        """
        address = None if newcomer.client is None else newcomer.client[0]
        if address is None or self._is_proxy(address):
            return True
        others = [one for one in connections if one is not newcomer and getattr(one, "client", None)]
        others = [one for one in others if getattr(one, "is_open", True)]
        same = [one for one in others if one.client[0] == address]
        if len(same) < self._most:
            return True
        waiting: list[Connection] = [one for one in same if getattr(one, "waits", False)]
        if waiting:
            min(waiting, key=lambda one: one.opened_s).hang_up()
        return bool(waiting)

    def _is_proxy(self, address: str) -> bool:
        if "*" in self._proxies or address in self._proxies:
            return True
        networks = [ipaddress.ip_network(one, strict=False) for one in self._proxies if "/" in one]
        return any(ipaddress.ip_address(address) in network for network in networks)
