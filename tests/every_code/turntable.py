"""Rows of the turntable: a solved one with a figure at either side of its limit, or cells with a trouble."""

from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from calib_core.captures.content import sphere_of
from calib_core.captures.observe import observe_capture
from calib_core.chain.encoder_scales import EncoderScale
from calib_core.chain.mirrored import MirrorImage
from calib_core.chain.moved import OpticsError
from calib_core.chain.observations import TableObservation
from calib_core.chain.table_given import KnownTool
from calib_core.chain.table_tool import ToolMove
from calib_core.chain.tcp import solve_tcp
from calib_core.chain.turntable import TurntableSolution, solve_turntable
from calib_core.chain.whole import ChainSolution, solve_chain
from calib_core.findings import Finding
from calib_core.frames import FloatArray
from calib_core.records import Cell
from calib_core.stages.chain.result import disagreements
from calib_core.stages.turntable.play import play_findings
from calib_core.stages.turntable.solve import about_tool, table_options
from calib_core.stages.turntable.verdict import table_findings
from tests.every_code.made import CELL, Case, solved, table_of
from tests.every_code.tcp import scattered


@cache
def whole() -> tuple[ChainSolution, list[TableObservation], Cell]:
    """Return a right cell's chain, solved, with its captures of the table."""
    cell = CELL.session.cell
    seen = [(c, observe_capture(CELL.session, c, CELL.files.__getitem__)) for c in CELL.session.captures]
    still = [o for c, o in seen if c.step == "tcp"]
    turning = [
        TableObservation(o, float(np.deg2rad(c.table_deg or 0.0)), c.mount or "")
        for c, o in seen
        if c.step == "turntable"
    ]
    sphere, options = sphere_of(cell, CELL.session.captures), table_options(cell)
    tcp = solve_tcp(still, sphere)
    table = solve_turntable(turning, sphere, KnownTool(tcp.joint.mount_from_laser, tcp.held), options)
    return solve_chain(still, turning, sphere, tcp, table, options), turning, cell


def table(**fields: Any) -> Case:
    """Return what is noticed of a right table with other figures."""

    def case() -> Iterable[Finding]:
        chain, turning, cell = whole()
        return table_findings(replace(chain.turntable, **fields), turning, cell)

    return case


def both(field: str, beyond: Any, within: Any) -> tuple[Case, Case]:
    """Return what is noticed with a figure at either side of its limit."""
    return table(**{field: beyond}), table(**{field: within})


def changed(change: Any) -> Case:
    """Return what is noticed of a right table that a function changed."""

    def case() -> Iterable[Finding]:
        chain, turning, cell = whole()
        return table_findings(change(chain.turntable), turning, cell)

    return case


def of_covariance(**variances: float) -> Case:
    """Return what is noticed of an axis whose direction or place has such a variance along base x."""

    def change(found: TurntableSolution) -> TurntableSolution:
        wider = {name: value * np.diag([1.0, 1e-3, 1e-3]) for name, value in variances.items()}
        return replace(found, covariance=replace(found.covariance, **wider))

    return changed(change)


def mirrored(lean_deg: float, apart_mm: float) -> Case:
    """Return what is noticed of an axis that may be its mirror image, so far off."""

    def change(found: TurntableSolution) -> TurntableSolution:
        state = whole()[0].tcp.held.state
        return replace(found, image=MirrorImage(state, 0.0, np.deg2rad(lean_deg), apart_mm, by_sense=False))

    return changed(change)


def rejected(count: int) -> Case:
    """Return what is noticed where so many captures are left out."""
    return changed(lambda found: replace(found, used=np.arange(len(found.used)) >= count))


def off_circles(distance_mm: float) -> Case:
    """Return what is noticed where captures lie so far off their circles."""

    def change(found: TurntableSolution) -> TurntableSolution:
        off = found.residuals.expected_in_base + np.array([distance_mm, 0.0, 0.0])
        return replace(found, residuals=replace(found.residuals, centers_in_base=off))

    return changed(change)


def heights(apart_mm: float) -> Case:
    """Return what is noticed where the mountings' heights are so far apart."""

    def change(found: TurntableSolution) -> TurntableSolution:
        mounts: FloatArray = found.frame.mounts_mm.copy()
        mounts[:, 2] = np.linspace(0, apart_mm, len(mounts))
        return replace(found, frame=replace(found.frame, mounts_mm=mounts))

    return changed(change)


def of_options(**options: Any) -> Case:
    """Return what is noticed of a table that was solved with other options."""
    return changed(lambda found: replace(found, options=replace(found.options, **options)))


def by_angle(sigma_deg: float) -> Case:
    """Return what is noticed where nobody told the angles' sigma, and it is found so."""

    def change(found: TurntableSolution) -> TurntableSolution:
        told = replace(found.options, angle_sigma_rad=None)
        return replace(found, options=told, sigmas=replace(found.sigmas, axes=(np.deg2rad(sigma_deg),)))

    return changed(change)


def scatter(times: float) -> Case:
    """Return what is noticed where captures scatter so many times what is told of the robot."""

    def change(found: TurntableSolution) -> TurntableSolution:
        told = replace(found.options, position_sigma_mm=0.05)
        return replace(
            found, options=told, sigmas=replace(found.sigmas, position_mm=times * 0.05, alike_position_mm=0.0)
        )

    return changed(change)


def again(apart_deg: float | None) -> Case:
    """Return what an angle says that was captured again; None: none was."""

    def case() -> Iterable[Finding]:
        result = solved("turntable", "turntable", 2)
        own = [row.model_copy(update={"angle_deg": 0.0}) for row in result.residuals if row.mount == "low"]
        twice = own[0].model_copy(update={"capture": "again", "angle_deg": apart_deg})
        rows = own if apart_deg is None else [*own, twice]
        exact = result.variance_components.model_copy(update={"position_sigma_mm": 0.0})
        fields = {"residuals": rows, "angle_sigma_deg": 0.0, "variance_components": exact}
        return play_findings(result.model_copy(update=fields))

    return case


def after_tool(optics: tuple[Any, ...] = (), **sigmas: float) -> Case:
    """Return what the turntable says of a tool whose poses scatter so, or that frames of optics told."""

    def case() -> Iterable[Finding]:
        tcp = whole()[0].tcp
        told = replace(scattered(tcp, **sigmas), beside=replace(tcp.beside, optics=optics))
        return about_tool(told, CELL.session.captures)

    return case


def chain(**distances: float) -> Case:
    return lambda: disagreements(replace(whole()[0], **distances))


OPTICS = OpticsError("camera", np.zeros(1), np.zeros(3), np.zeros(3), np.zeros((3, 3)))
MOVED_OFF = np.full(6, 0.1)
CASES: dict[str, tuple[Case, Case]] = {
    "axis-tilt-undetermined": (
        of_covariance(axis_direction=np.deg2rad(0.51) ** 2),
        of_covariance(axis_direction=np.deg2rad(0.49) ** 2),
    ),
    "axis-mirrored": (mirrored(0.0, 3.1), mirrored(0.49, 2.9)),
    "axis-place-undetermined": (of_covariance(axis_point=3.1**2), of_covariance(axis_point=2.9**2)),
    "many-table-captures-contradict": (rejected(6), rejected(5)),
    "table-captures-contradict": (rejected(1), rejected(0)),
    "table-angles-do-not-fit": (off_circles(5.1), off_circles(4.9)),
    "tool-seen-elsewhere-on-table": both(
        "tool_move", ToolMove(MOVED_OFF, 0.0029, 1.0), ToolMove(MOVED_OFF, 0.0031, 1.0)
    ),
    "table-pushed": (table_of("pushed by 0.3 mm between the mountings", "chain"), table_of("clean", "chain")),
    "table-creeps": (table_of("creeps by 0.3 mm", "chain"), table_of("clean", "chain")),
    "sphere-reseated": (table_of("sphere slips by 0.5 mm", "chain"), table_of("clean", "chain")),
    "clamp-gives": (table_of("a clamp gives by 0.5 mm", "chain"), table_of("clean", "chain")),
    "sphere-remounted": (table_of("sphere slips by 3 mm"), table_of("clean")),
    "table-scatter-beyond-told": (scatter(1.6), scatter(1.4)),
    "table-angles-not-read": (of_options(angles_unknown=True), of_options(angles_unknown=False)),
    "one-height": (heights(19.0), heights(21.0)),
    "axis-direction-weak": (
        of_covariance(axis_direction=np.deg2rad(0.11) ** 2),
        of_covariance(axis_direction=np.deg2rad(0.09) ** 2),
    ),
    "axis-wobbles": (table_of("wobbles by 1 mrad three times a turn"), table_of("clean")),
    "encoder-eccentric": (table_of("encoder eccentric by 0.1°"), table_of("clean")),
    "encoder-scale": both("encoders", {0: EncoderScale(5e-4, 1e-4, True)}, {0: EncoderScale(3e-4, 1e-4, False)}),
    "table-angles-scatter": (by_angle(0.051), by_angle(0.049)),
    "play-not-checked": (again(None), again(0.0)),
    "table-play": (again(0.011), again(0.009)),
    "table-angles-repeat": (again(0.009), again(0.011)),
    "tcp-failed-before": (after_tool(position_mm=2.6), after_tool(position_mm=2.4)),
    "tcp-doubtful-before": (after_tool(position_mm=1.1), after_tool(position_mm=0.9)),
    "optics-by-tool-alone": (after_tool((OPTICS,)), after_tool()),
    "chain-tool-differs": (chain(tcp_distance=22.6), chain(tcp_distance=22.4)),
    "chain-table-differs": (chain(turntable_distance=20.6), chain(turntable_distance=20.4)),
}
