"""`scancell plan`: what a cell will reach, before anything is bought or mounted."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib_core.errors import InputError
from calib_core.messages import message
from server.console.command import NOT_ACCEPTED, OK, Command
from server.console.output import print_result, read_object

if TYPE_CHECKING:
    from calib_core.guidance.cell_plan import CellPlan
    from calib_core.guidance.edges_plan import PlannedCapture, PlannedEdge


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "file",
        nargs="?",
        type=Path,
        metavar="FILE",
        help="the cell as JSON, its edges too; options win",
    )
    for name, what in (
        ("near-mm", "where the scanner's field of view begins"),
        ("far-mm", "where it ends"),
        ("near-width-mm", "its width where it begins"),
        ("far-width-mm", "its width where it ends (as where it begins)"),
        ("noise-mm", "standard deviation of a point (0.02)"),
        ("pitch-mm", "between points along the stripe (0.1)"),
        ("sphere-mm", "the sphere's diameter (the usual ones are tried)"),
        ("wanted-mm", "the wanted ± at the workpiece, k = 2"),
        ("tilt-deg", "how far the scanner can lean (30)"),
    ):
        parser.add_argument(f"--{name}", type=float, metavar=name.rsplit("-", 1)[-1].upper(), help=what)
    parser.add_argument("--table", action="store_true", help="with a turntable")
    for name, what in (
        ("part-radius-mm", "how far off the table's axis the workpiece reaches (100)"),
        ("part-height-mm", "how high it is (150)"),
        ("angle-noise-deg", "standard deviation of the table's angle (0.005)"),
    ):
        parser.add_argument(f"--{name}", type=float, metavar=name.rsplit("-", 1)[-1].upper(), help=what)
    parser.add_argument("--arm", choices=("calibrated", "ordinary", "nominal"), help="the arm's class (ordinary)")
    parser.add_argument("--arm-name", metavar="NAME", help="a known arm: what its own errors are worth")
    parser.add_argument(
        "--sphere-class", choices=("certified", "bearing", "coated", "turned"), help="how exact it is (certified)"
    )


def _run(options: argparse.Namespace) -> int:
    """Print the plan; return 1 where the wanted figure is out of reach."""
    from calib_core.guidance.cell_plan import CellToPlan, plan_cell
    from calib_core.records.described import DescribedCell
    from calib_core.records.parsing import written_record

    where = str(options.file or "plan")
    plan = plan_cell(written_record(CellToPlan, _cell(options), where, beside=DescribedCell))
    print_result(options, _text(plan), plan.model_dump(mode="json"))
    return NOT_ACCEPTED if plan.reachable is False else OK


def _cell(options: argparse.Namespace) -> dict[str, Any]:
    """Return the cell of the file with what the options say."""
    data: dict[str, Any] = {} if options.file is None else read_object(options.file)
    data |= _given(
        point_sigma_mm=options.noise_mm,
        pitch_mm=options.pitch_mm,
        sphere_diameter_mm=options.sphere_mm,
        sphere_class=options.sphere_class,
        wanted_mm=options.wanted_mm,
        arm=options.arm,
        arm_name=options.arm_name,
    )
    names = ("near_mm", "far_mm", "near_width_mm", "far_width_mm")
    _add(data, "scanner", _given(**{name: getattr(options, name) for name in names}))
    if "scanner" not in data:
        to_do = message(
            "Give --near-mm, --far-mm and --near-width-mm, or a cell as a JSON file; see docs/guidance.md."
        )
        raise InputError("where the scanner measures", "nothing", to_do, str(options.file or "plan"))
    if options.table and data.get("table") is None:
        data["table"] = {}
    radius_mm, height_mm = options.part_radius_mm, options.part_height_mm
    _add(data, "table", _given(radius_mm=radius_mm, height_mm=height_mm, angle_sigma_deg=options.angle_noise_deg))
    _add(data, "limits", _given(tilt_deg=options.tilt_deg))
    return data


def _given(**values: Any) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value is not None}


def _add(data: dict[str, Any], name: str, told: dict[str, Any]) -> None:
    """Let options win over a record of the file; what is no record stays, for the cell's check to refuse."""
    given = data.get(name)
    if told and (given is None or isinstance(given, dict)):
        data[name] = {**(given or {}), **told}


def _text(plan: "CellPlan") -> str:
    from calib_core.messages import message

    seen = message(
        "Let the scanner see the sphere at {distance_mm:.0f} mm, the stripe {offset_mm:.0f} mm beside its middle.",
        distance_mm=plan.distance_mm,
        offset_mm=plan.offset_mm,
    )
    helpless = message("More captures do not help against {limited_by}.", limited_by=plan.limited_by)
    lines = [plan.sentence, f"  {helpless}", f"  {seen}"]
    lines += [f"  {plan.arm_sentence}"] if plan.arm_sentence else []
    lines += [f"  {plan.where}", "", f"  {'sphere':>9} {'captures':>9} {'then':>10}"]
    for one in plan.spheres:
        captures = "–" if one.captures is None else str(one.captures)
        reached = one.uncertainty_mm if one.captures is None else one.after_mm[one.captures - 1]
        lines.append(f"  {one.diameter_mm:6g} mm {captures:>9} ± {reached or 0.0:.3f} mm")
    if plan.table is not None:
        lines += ["", plan.table.sentence, f"  {'off axis':>9} {'heights':>8} {'angles':>7} {'then':>10}"]
        for layout in plan.table.layouts:
            heights = f"{len(layout.heights_mm)}"
            leaves = f"± {layout.uncertainty_mm:.3f} mm"
            lines.append(f"  {layout.radius_mm:6g} mm {heights:>8} {layout.angles:>7} {leaves:>10}")
    if plan.edges is not None:
        lines += ["", plan.edges.sentence, *(f"  {one}" for one in plan.edges.unseen)]
        lines += [line for edge in plan.edges.edges for line in _edge(edge)]
        lines += [f"  {number:>3}  {_capture(one)}" for number, one in enumerate(plan.edges.captures, start=1)]
    return "\n".join(lines)


def _edge(edge: "PlannedEdge") -> list[str]:
    known = [
        f"± {value:.3g} {unit}" for value, unit in ((edge.position_mm, "mm"), (edge.orientation_deg, "°")) if value
    ]
    return [f"  {edge.title}: {', '.join(known)}".rstrip(": "), *(f"    {one}" for one in edge.open)]


def _capture(one: "PlannedCapture") -> str:
    """Return a capture's line: of which sphere by which scanner, where the axes stand, ± after it."""
    from calib_core.messages import message

    after = message("not determined yet") if one.uncertainty_mm is None else f"± {one.uncertainty_mm:.3f} mm"
    axes = [f"{name} {value:g}°" for name, value in (one.axes_deg or {}).items()]
    axes += [f"{name} {value:g} mm" for name, value in (one.axes_mm or {}).items()]
    at = " ".join(f"{row[3]:.0f}" for row in one.base_from_tool0[:3]) if one.by_robot else ""
    flange = message("flange at {at}", at=at) if at else message("axes alone")
    return "  ".join([one.scanner or "", one.sphere, *axes, flange, after]).strip()


COMMAND = Command("plan", "what a cell will reach, before anything is bought", "files", _arguments, _run)
