"""`scancell simulate`: a session folder whose truth is known."""

import argparse
from pathlib import Path

from server.console.command import OK, Command
from server.console.output import print_result


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scenario", metavar="SCENARIO", help="tcp, or one of its variants")
    parser.add_argument("--seed", type=int, required=True, metavar="N", help="the same seed gives the same files")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="the folder to write")


def _run(options: argparse.Namespace) -> int:
    """Write the session folder of a simulated cell, with truth.json beside session.json."""
    from calib_core.archive.folder import save_session, to_json_bytes
    from calib_core.simulation import simulate

    simulated = simulate(options.scenario, options.seed)
    truth = {"truth.json": to_json_bytes(simulated.truth)}
    save_session(options.out, simulated.session, {**simulated.files, **truth})
    captures = len(simulated.session.captures)
    text = f"{options.out}: {captures} captures, scenario {options.scenario}, seed {options.seed}"
    data = {"folder": str(options.out), "captures": captures, "scenario": options.scenario, "seed": options.seed}
    print_result(options, text, data)
    return OK


COMMAND = Command(
    "simulate", "write the session folder of a simulated cell, truth.json beside it", "files", _arguments, _run
)
