"""What the merge's result says of itself."""

from math import degrees, hypot
from typing import Final

from calib_core.evidence.numbers import fixed, number_text, plus_minus, quantity, rms, same_decimals
from calib_core.messages import message, plural
from calib_core.records import Session
from calib_core.records.evidence import AnyBlock, Axis, Column, Figure, Note, Plot, Row, Series, Table
from calib_core.stages.evidence_parts import capture_series, captures_used, left_out, provenance, source_text
from calib_core.stages.merge.record import Alignment, Deviation, MergeResidual, MergeResult, PartSection

_DROPPED: Final = (("stray", "Stray"), ("mixed", "Mixed"), ("grazing", "Grazing"))


def evidence(session: Session, result: MergeResult) -> list[AnyBlock]:
    """Return the merge told in blocks, the answer first."""
    return [
        *_headline(result),
        captures_used(result),
        *_apart(result),
        *_cloud(session, result),
        *_nominal(result),
        *_scan_plot(result),
        *left_out(result.residuals),
        _scans(result),
        *provenance(result),
    ]


def _headline(result: MergeResult) -> list[AnyBlock]:
    found: list[AnyBlock] = []
    if result.surface_sigma_mm is not None and _believed(result):
        shown = plus_minus(result.surface_sigma_mm, "mm")
        found.append(Figure(label="Merged surface", quantity=shown, remark="along its normal", headline=True))
    if (off := result.deviation) is not None:
        found.append(
            Figure(label="Deviation from the nominal, RMS", quantity=rms(off.rms_mm, "mm"), headline=True)
        )
        found += _within(off)
    if result.overlap_rms_mm is not None:
        pair = (result.overlap_rms_mm, result.expected_overlap_rms_mm)
        apart, *expected = same_decimals([rms(one, "mm") for one in pair if one is not None])
        found.append(
            Figure(
                label="Scans lie apart, RMS",
                quantity=apart,
                limit=next(iter(expected), None),
                limit_label="expected",
                headline=True,
            )
        )
    return [*found, Figure(label="Points", quantity=fixed(result.points, 0), headline=True)]


def _believed(result: MergeResult) -> bool:
    """Return whether what the merge says of its own uncertainty holds: where scans do not fit, nothing does."""
    return result.verdict != "fail"


def _apart(result: MergeResult) -> list[AnyBlock]:
    if result.overlap_rms_mm is None:
        return []
    blocks: list[AnyBlock] = [
        Figure(
            title="How far scans lie apart",
            label="Measured before any registration, RMS",
            quantity=rms(result.overlap_rms_mm, "mm"),
        ),
        Figure(
            label="Expected from noise and calibration, RMS", quantity=rms(result.expected_overlap_rms_mm, "mm")
        ),
    ]
    if result.registered_overlap_rms_mm is not None:
        blocks += [
            Figure(label="After registration, RMS", quantity=rms(result.registered_overlap_rms_mm, "mm")),
            Figure(
                label="Registration moved the scans by, RMS", quantity=rms(result.registration_shift_rms_mm, "mm")
            ),
        ]
    blocks.append(Figure(label="Places compared", quantity=fixed(result.overlap_pairs, 0)))
    shared = result.self_calibration
    if shared is not None:
        moved = number_text(hypot(*shared.shift[3:6]), 3)
        text = plural(
            "The overlap determines {count} direction of tool and table better than the captures did; "
            "it moved the tool by {moved} mm.",
            "The overlap determines {count} directions of tool and table better than the captures did; "
            "it moved the tool by {moved} mm.",
            by="count",
            count=shared.directions,
            moved=moved,
        )
        blocks.append(Note(text=text))
    return blocks


def _cloud(session: Session, result: MergeResult) -> list[AnyBlock]:
    sides = zip(result.low_mm, result.high_mm, strict=True)
    size = " × ".join(number_text(high - low, 1) for low, high in sides)
    figures: list[AnyBlock] = [
        Figure(title="Merged cloud", label="Points scanned", quantity=fixed(result.scanned_points, 0)),
        Figure(label="Voxel size", quantity=fixed(result.voxel_mm, 2, "mm")),
        Figure(label="Size, x × y × z", text=f"{size}\u202fmm", remark=_WHERE[result.frame]),
    ]
    if result.mesh or result.triangles:
        figures.append(Figure(label="Triangles of the mesh", quantity=fixed(result.triangles, 0)))
    if result.mesh_open_edges is not None:
        remark = message("watertight") if not result.mesh_open_edges else ""
        figures.append(Figure(label="Open edges", quantity=fixed(result.mesh_open_edges, 0), remark=remark))
    if result.calibrated_by is not None:
        figures.append(Figure(label="Calibration from", text=source_text(result.calibrated_by, session.cell)))
    return figures


_WHERE: Final = {
    "turntable": message("in the frame of what carries the object"),
    "base": message("in the robot's base"),
    "tool0": message("in the flange's frame"),
}

_METHODS: Final = {
    "none": message("taken as it lies"),
    "best-fit": message("best fit to all points"),
    "3-2-1": message("six datum points (3-2-1)"),
    "datums": message("datum planes and spheres"),
    "matrix": message("as told"),
}

_SEEN: Final = (message("Radius"), message("Off the nominal's"), message("Points off it, RMS"))
_DATUMS: Final = {"plane": message("plane"), "sphere": message("sphere")}


def _nominal(result: MergeResult) -> list[AnyBlock]:
    """Return how far the part lies off its nominal, where one is told."""
    alignment, off = result.alignment, result.deviation
    if alignment is None or off is None:
        return []
    sigma = None if off.uncertainty_mm is None or not _believed(result) else quantity(off.uncertainty_mm, "mm")
    blocks: list[AnyBlock] = [
        Figure(
            title="Against the nominal",
            label="Deviation, RMS",
            quantity=rms(off.rms_mm, "mm"),
            limit=sigma,
            limit_label="standard uncertainty of a deviation",
        ),
        Figure(label="95 % of the points lie within", quantity=quantity(off.within_95_mm, "mm")),
        Figure(label="Mean deviation, positive outside", quantity=quantity(off.signed_mean_mm, "mm")),
        Figure(label="Points compared", quantity=fixed(off.points, 0), remark=_share(off)),
        *_laid(alignment, _believed(result)),
    ]
    width = 2 * off.limit_mm / len(off.histogram)
    lower = [-off.limit_mm + width * k for k in range(len(off.histogram))]
    return [
        *blocks,
        *(_section(one) for one in off.sections),
        Plot(
            id="deviations",
            title="Deviations from the nominal",
            shape="histogram",
            caption="How many merged points lie how far off the nominal; those beyond are in the outermost bins.",
            x=Axis(label="Deviation", unit="mm"),
            y=Axis(label="Points", low=0.0),
            series=[Series(x=lower, y=[float(count) for count in off.histogram])],
        ),
        Table(
            id="extremes",
            title="Farthest points",
            detail=True,
            caption="The places that lie farthest outside, then farthest inside, apart from each other.",
            columns=[
                *(Column(label=axis, unit="mm", decimals=2) for axis in "xyz"),
                Column(label="Deviation", unit="mm", decimals=3),
            ],
            rows=[Row(cells=[*point.point_mm, point.deviation_mm]) for point in off.extremes],
        ),
    ]


def _within(off: Deviation) -> list[AnyBlock]:
    if off.tolerance_mm is None or off.within_tolerance is None:
        return []
    beyond = None
    if off.above_tolerance is not None and off.below_tolerance is not None:
        beyond = message(
            "{above:.2f} % farther outside, {below:.2f} % farther inside",
            above=100 * off.above_tolerance,
            below=100 * off.below_tolerance,
        )
    label = message("Points within ± {tolerance_mm:g} mm", tolerance_mm=off.tolerance_mm)
    quantity = fixed(100 * off.within_tolerance, 2, "%")
    return [Figure(label=label, quantity=quantity, remark=beyond, headline=True)]


def _share(off: Deviation) -> str:
    if not off.across_edges:
        return message("{share:.0f} % of the cloud; the rest is too far off", share=100 * off.counted)
    return message(
        "{share:.0f} % of the cloud; the rest is too far off. {edges} points within a voxel of an edge do not "
        "count",
        share=100 * off.counted,
        edges=off.across_edges,
    )


def _laid(alignment: Alignment, believed: bool) -> list[AnyBlock]:
    """Return how the nominal was laid into the cloud, and how well that is known."""
    alike = message("{count} other poses fit as well", count=alignment.alike) if alignment.alike else None
    blocks: list[AnyBlock] = [
        Figure(label="Alignment of the nominal", text=_METHODS[alignment.method], remark=alike)
    ]
    if alignment.covariance is not None:
        goes_by = "Points that the alignment goes by lie off, RMS"
        blocks.append(Figure(label=goes_by, quantity=rms(alignment.rms_mm, "mm")))
    if alignment.covariance is not None and believed:
        variances = [alignment.covariance[k][k] for k in range(6)]
        blocks += [
            Figure(label="Place of the nominal's zero", quantity=plus_minus(sum(variances[3:]) ** 0.5, "mm")),
            Figure(label="Turn of the nominal", quantity=plus_minus(degrees(sum(variances[:3]) ** 0.5), "°")),
        ]
    if alignment.datums:
        blocks.append(
            Table(
                id="datums",
                title=message("Datums"),
                caption=message(
                    "Where each lies in the nominal's frame, and how far the points have it from there."
                ),
                columns=[
                    Column(label=message("Datum"), align="left"),
                    *(Column(label=axis, unit="mm", decimals=2) for axis in "xyz"),
                    *(Column(label=label, unit="mm", decimals=3) for label in _SEEN),
                ],
                rows=[
                    Row(cells=[_DATUMS[one.kind], *one.at_mm, one.radius_mm, one.off_mm, one.rms_mm])
                    for one in alignment.datums
                ],
            )
        )
    return blocks


def _section(section: PartSection) -> Plot:
    """Return the part cut open: the nominal as a line, the merged points as dots with magnified deviations."""
    u, v = (axis for axis in "xyz" if axis != section.axis)
    lines = [place for u0, v0, u1, v1 in section.nominal for place in ((u0, v0), (u1, v1), (u1, None))]
    return Plot(
        id=f"section-{section.axis}",
        title=message("Section across {axis}", axis=section.axis),
        shape="section",
        caption=message(
            "The line is the nominal at {axis} = {at_mm:.2f} mm, dots are merged points, {times:g} × as far off.",
            axis=section.axis,
            at_mm=section.at_mm,
            times=section.magnified,
        ),
        x=Axis(label=u, unit="mm"),
        y=Axis(label=v, unit="mm"),
        series=[
            Series(label="nominal", x=[place[0] for place in lines], y=[place[1] for place in lines]),
            Series(
                label="merged points",
                x=[place[0] for place in section.points],
                y=[place[1] for place in section.points],
            ),
        ],
    )


def _scan_plot(result: MergeResult) -> list[AnyBlock]:
    rows = [row for row in result.residuals if row.overlap_rms_mm is not None]
    if not rows:
        return []
    return [
        Plot(
            id="residuals",
            title="Distance to other scans",
            shape="captures",
            caption="How far each scan lies from those that overlap it, RMS, beside what is expected. A scan "
            "farther off than expected has a wrong pose or angle, or the object moved.",
            x=Axis(label="Scan"),
            y=Axis(label="Apart", unit="mm", low=0.0),
            series=[
                capture_series(rows, [row.overlap_rms_mm for row in rows], message("measured")),
                capture_series(rows, [row.expected_overlap_rms_mm for row in rows], "expected"),
            ],
        )
    ]


def _scans(result: MergeResult) -> Table:
    moved = any(row.shift_mm is not None for row in result.residuals)
    columns = [Column(label="Scan", align="left"), Column(label="Points"), Column(label="Kept")]
    columns += [Column(label=label, unit="%", decimals=1) for _, label in _DROPPED]
    columns += [Column(label=label, unit="mm", decimals=4) for label in ("Off the others", "Expected")]
    if moved:
        columns += [Column(label="Moved", unit="mm", decimals=4), Column(label="Turned", unit="°", decimals=4)]
    return Table(
        id="scans",
        title="Each scan",
        detail=True,
        caption="Stray points lie on no surface, mixed ones between two at an edge, grazing ones were seen at too "
        "flat an angle.",
        columns=columns,
        rows=[_scan(row, moved) for row in result.residuals],
    )


def _scan(row: MergeResidual, moved: bool) -> Row:
    shares = [100 * getattr(row, name) / row.points if row.points else None for name, _ in _DROPPED]
    cells = [row.capture, row.points, row.kept, *shares, row.overlap_rms_mm, row.expected_overlap_rms_mm]
    if moved:
        cells += [row.shift_mm, row.turn_deg]
    return Row(cells=cells, capture=row.capture, used=row.used, reason=row.reason)
