"""`scancell simulate`: a session folder whose truth is known; `simulate live`: the cell's devices, served."""

import argparse
import json
import time
from pathlib import Path
from typing import TYPE_CHECKING

from calib_core.errors import InputError
from server.console.command import OK, Command
from server.console.output import print_result

if TYPE_CHECKING:
    from calib_core.records.described import DescribedCell

_LIVE = "live"


def _arguments(parser: argparse.ArgumentParser) -> None:
    help_ = "tcp, one of its variants, or a cell as JSON, as plan takes it; live serves a cell's devices"
    parser.add_argument("scenario", metavar="SCENARIO", help=help_)
    parser.add_argument("--seed", type=int, metavar="N", help="the same seed gives the same files")
    parser.add_argument("--out", type=Path, metavar="DIR", help="the folder to write; not for live")
    parser.add_argument("--cell", default="turntable", metavar="NAME", help="live: the cell (%(default)s)")
    parser.add_argument(
        "--host", default="127.0.0.1", metavar="HOST", help="live: where it is served (%(default)s)"
    )
    parser.add_argument(
        "--scanner",
        choices=("profiles", "camera"),
        default="profiles",
        help="live: profiles over HTTP, or a raw camera by GigE Vision (%(default)s)",
    )
    parser.add_argument(
        "--rest", type=float, default=3.0, metavar="S", help="live: how long it stands (%(default)s)"
    )
    parser.add_argument("--rounds", type=int, metavar="N", help="live: end after so many; left out, at Ctrl-C")


def _run(options: argparse.Namespace) -> int:
    """Write the session folder of a simulated cell, with truth.json beside session.json; or serve its devices."""
    if options.scenario == _LIVE:
        return _serve(options)
    from calib_core.messages import message
    from calib_core.simulation import require_scenario, simulate, simulate_described

    described = Path(options.scenario) if options.scenario.endswith(".json") else None
    if described is None:
        require_scenario(options.scenario)
    for name, value in (("--seed", options.seed), ("--out", options.out)):
        if value is None:
            need = "{name} for the session folder"
            raise InputError(need, "none", "Add {name}.", f"simulate {options.scenario}", name=name)
    from calib_core.archive.folder import save_session, to_json_bytes

    if described is None:
        simulated = simulate(options.scenario, options.seed)
    else:
        simulated = simulate_described(_described(described), described.stem, options.seed)
    truth = {"truth.json": to_json_bytes(simulated.truth)}
    save_session(options.out, simulated.session, {**simulated.files, **truth})
    captures = len(simulated.session.captures)
    text = message(
        "{folder}: {captures} captures, scenario {scenario}, seed {seed}",
        folder=str(options.out),
        captures=captures,
        scenario=options.scenario,
        seed=options.seed,
    )
    data = {"folder": str(options.out), "captures": captures, "scenario": options.scenario, "seed": options.seed}
    print_result(options, text, data)
    return OK


def _described(file: Path) -> "DescribedCell":
    """Return the cell of a file, as `plan` takes it; raises InputError where it is none."""
    from calib_core.cell.described import cell_of
    from calib_core.guidance.cell_plan import CellToPlan
    from calib_core.records.described import DescribedCell
    from calib_core.records.parsing import written_record
    from server.console.output import read_object

    told = written_record(DescribedCell, read_object(file), str(file), beside=CellToPlan)
    cell_of(told, pose_convention="matrix")  # edges that form no tree
    return told


def _serve(options: argparse.Namespace) -> int:
    """Serve the devices, and send the robot from capture to capture until stopped."""
    from server.simulated_cell.devices import SimulatedDevices

    camera = options.scanner == "camera"
    devices = SimulatedDevices(options.cell, options.seed or 1, host=options.host, camera=camera)
    sources = devices.sources(options.host)
    lines = ["The simulated cell is live. Its devices, as PUT …/sessions/{id}/devices/{name} takes them:"]
    lines += [f"  {name}: {json.dumps(source)}" for name, source in sources.items()]
    lines += [f"  cell, as POST /sessions takes it: {json.dumps(devices.record)}"]
    lines += [f"  robot as KUKA's variables: port {devices.variables.port}"]
    lines += [f"  robot and table over OPC UA: {devices.opcua.url}"] if devices.opcua else []
    print_result(options, "\n".join(lines), {"devices": sources, "cell": devices.record})
    try:
        rounds = 0
        while options.rounds is None or rounds < options.rounds:
            rounds += 1
            for number in range(len(devices.cell.shots)):
                devices.go(number)
                time.sleep(options.rest)
    except KeyboardInterrupt:
        pass
    finally:
        devices.stop()
    return OK


COMMAND = Command(
    "simulate", "write a simulated session with its truth, or serve its devices live", "files", _arguments, _run
)
