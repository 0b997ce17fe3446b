"""Which addresses a webhook may reach: checked when it connects, so that a name cannot point elsewhere by then."""

import socket
from ipaddress import IPv4Address, IPv6Address, IPv6Network, ip_address
from typing import Final

import httpx

from server.settings import Settings

Address = IPv4Address | IPv6Address

_NAT64: Final = IPv6Network("64:ff9b::/96")
_OF_CLOUDS: Final = tuple(map(ip_address, ("fd00:ec2::254", "100.100.100.200", "168.63.129.16", "192.0.0.192")))
"""Where clouds keep secrets beside the link-local address."""


class CheckedTransport(httpx.BaseTransport):
    """Sends to the address that was checked, under the name that was asked for (Host header and TLS name).

    Refused are this server itself, so that a webhook cannot call its API with the trust of this machine;
    link-local, multicast and unspecified addresses, where clouds keep their secrets; and, unless the
    settings allow it, programs on this machine.
    """

    def __init__(self, settings: Settings, inner: httpx.BaseTransport) -> None:
        self._settings, self._inner = settings, inner

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        """Send; raises ConnectError where no address of the receiver may be reached."""
        host = request.url.host
        port = request.url.port or (443 if request.url.scheme == "https" else 80)
        address = self._checked(host, port)
        request.extensions = {**request.extensions, "sni_hostname": host}
        request.url = request.url.copy_with(host=address)  # the Host header was written before
        return self._inner.handle_request(request)

    def close(self) -> None:
        """Close connections that are kept."""
        self._inner.close()

    def _checked(self, host: str, port: int) -> str:
        refused = ""
        for _, _, _, _, place in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM):
            refused = self._refusal(ip_address(str(place[0]).partition("%")[0]), port)
            if not refused:
                return str(place[0])
        raise httpx.ConnectError(f"a webhook may not reach {host}: {refused}")

    def _refusal(self, address: Address, port: int) -> str:
        address = _meant(address)
        if address.is_link_local or address.is_multicast or address.is_unspecified or address in _OF_CLOUDS:
            return f"{address} is no receiver's address"
        if not _is_here(address):
            return ""
        if port == self._settings.port:
            return "it is this server itself"
        if not self._settings.webhooks_to_this_machine:
            return "it is this machine (SCANCELL_WEBHOOKS_TO_THIS_MACHINE=true allows it)"
        return ""


def _meant(address: Address) -> Address:
    """Return the IPv4 address that an IPv6 one stands for: mapped, compatible, of 6to4 or of a NAT64."""
    if address.version == 4:
        return address
    embedded = IPv4Address(int(address) & 0xFFFFFFFF) if address in _NAT64 or 1 < int(address) < 2**32 else None
    return address.ipv4_mapped or address.sixtofour or embedded or address


def _is_here(address: Address) -> bool:
    """Return whether an address belongs to this machine: only then a socket can be bound to it."""
    if address.is_loopback:
        return True
    family = socket.AF_INET6 if address.version == 6 else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        try:
            probe.bind((str(address), 0))
        except OSError:
            return False
    return True
