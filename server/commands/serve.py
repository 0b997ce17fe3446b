"""`scancell serve`: the workbench in a browser."""

import argparse
import gc
import signal
import socket
import threading
import time
from contextlib import suppress
from typing import TYPE_CHECKING

from calib_core.messages import message
from server.console.command import OK, Command, address_arguments
from server.console.output import print_result, remark

if TYPE_CHECKING:
    from server.serve import WorkbenchServer


_ENDINGS = [number for name in ("SIGINT", "SIGTERM", "SIGBREAK") if (number := getattr(signal, name, None))]
"""SIGBREAK is Windows': Ctrl-Break, and how another program ends one that has a console."""

_ANSWERS_S = 2.0

_OWN_ADDRESS = getattr(socket, "SO_EXCLUSIVEADDRUSE", socket.SO_REUSEADDR)
"""Windows lets an address that is in use be shared by the option that elsewhere takes one that was just let go."""


def serve(options: argparse.Namespace) -> int:
    """Serve until stopped, after printing the address."""
    from calib_core.errors import InputError
    from calib_core.windows_runtime import require_runtime

    require_runtime()
    host, port = options.host, options.port
    if not 0 <= port <= 65535:
        raise InputError("a port from 0 to 65535", str(port), "Name another.", "--port")
    if options.open and (running := _running(host, port)):
        _open(running)
        told = message("The workbench runs already, at {address}", address=running)
        print_result(options, told, {"address": running})
        return OK
    _require_free(host, port)
    gc.disable()  # until it serves: what is imported stays
    from server.heap import keep_little
    from server.jobs.child_processes import begin_loading, end_loading
    from server.logs import set_up
    from server.settings import Settings

    tls = {"tls_certificate": options.tls_cert, "tls_key": options.tls_key}
    given = {name: path for name, path in tls.items() if path is not None}
    settings = Settings(host=host, port=port, data=options.data, **given)
    keep_little()
    set_up(settings.log)
    begin_loading(settings.warm_up)  # on another core, while this one imports what serves
    from server.serve import WorkbenchServer

    server = WorkbenchServer(settings)
    for ending in _ENDINGS:  # uvicorn hears them between its very start and end alone
        signal.signal(ending, server.handle_exit)
    threading.Thread(target=_announce, args=(options, server), daemon=True).start()
    server.run()
    end_loading()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a second Ctrl-C comes too late to hurry anything
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if not options.json:
        print_result(options, message("The workbench has stopped."), {})
    return OK


def _announce(options: argparse.Namespace, server: "WorkbenchServer") -> None:
    while not server.started:
        if server.should_exit:
            return
        time.sleep(0.05)
    with suppress(IndexError):  # it may be stopped just as it has started
        address = server.address
        told = message("The workbench is at {address} (Ctrl-C ends it)", address=address)
        print_result(options, told, {"address": address})
        if options.open:
            _open(address)
    if server.is_in_the_clear:
        remark(
            options,
            "Tokens and measurements travel unencrypted. Serve so on a network that you trust alone, or set "
            "SCANCELL_TLS_CERTIFICATE and SCANCELL_TLS_KEY.",
        )


def _running(host: str, port: int) -> str | None:
    """Return the address of a workbench that answers there already, encrypted or not; None where none does."""
    from server.settings import address_of

    found = (address_of(scheme, host, port) for scheme in ("http", "https"))
    return next((address for address in found if b'"version"' in _health(address)), None)


def _health(address: str) -> bytes:
    """Return what is said there of its health, also by what still starts (503) or has a certificate of its own."""
    import ssl
    from http.client import HTTPException
    from urllib.error import HTTPError
    from urllib.request import HTTPSHandler, ProxyHandler, build_opener

    anybody = ssl.create_default_context()
    anybody.check_hostname, anybody.verify_mode = False, ssl.CERT_NONE  # nothing is told it, and nothing believed
    opener = build_opener(ProxyHandler({}), HTTPSHandler(context=anybody))
    try:
        with opener.open(f"{address}/api/v1/health", timeout=_ANSWERS_S) as answer:
            return answer.read()
    except HTTPError as error:
        with error:
            return error.read() if error.code == 503 else b""
    except (OSError, HTTPException, ValueError):
        return b""


def _open(address: str) -> None:
    """Show it in the browser of whoever sits here; where there is none, the address is printed."""
    import webbrowser

    with suppress(webbrowser.Error, OSError):
        webbrowser.open(address)


def _require_free(host: str, port: int) -> None:
    """Refuse an address that cannot be served on, before anything is started."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family, socket.SOCK_STREAM) as trial:
            trial.setsockopt(socket.SOL_SOCKET, _OWN_ADDRESS, 1)
            trial.bind((host, port))
    except OSError as error:
        from calib_core.errors import InputError

        got = error.strerror or type(error).__name__
        to_do = message("Choose another with --port (0: any that is free) or --host.")
        raise InputError("an address to serve on", got.lower(), to_do, f"{host}:{port}") from None


COMMAND = Command("serve", "serve the workbench", "workbench", address_arguments, serve)
