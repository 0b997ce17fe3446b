"""`scancell certificate`: the diameter in a sphere's digital calibration certificate."""

import argparse
from pathlib import Path

from calib_core.messages import message
from server.console.command import OK, Command
from server.console.output import print_result


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE", help="the certificate's XML (DCC)")


def _run(options: argparse.Namespace) -> int:
    """Print the certificate's diameters as a session's cell takes them."""
    from calib_core.archive.folder import read_bytes
    from calib_core.captures.certificate import read_certificate

    found = read_certificate(
        read_bytes(options.file, message("Name the certificate's XML file.")), str(options.file)
    )
    unnumbered = message("certificate without a number")
    lines: list[str] = [
        message("certificate {number}", number=found.identifier) if found.identifier else unnumbered
    ]
    for one in found.diameters:
        told = f'{one.name}: "sphere_diameter_mm": {one.diameter_mm:.10g}'
        if one.sigma_mm is None:
            lines.append("  " + message("{told}, no uncertainty", told=told))
        else:
            lines.append(f'  {told}, "sphere_diameter_sigma_mm": {one.sigma_mm:g}')
    print_result(options, "\n".join(lines), found.to_json())
    return OK


COMMAND = Command("certificate", "the diameter in a sphere's digital certificate", "files", _arguments, _run)
