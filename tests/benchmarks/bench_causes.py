"""Root causes: every wrong reading of poses, swapped and shifted ones, on simulated cells and both real sets."""

from collections import Counter

import numpy as np
from bench_halves import DATA, SETS
from cells import Cell
from harness import Row
from wrong_lengths import ANGLES, SCALES, scaled_files, told_angles
from wrong_poses import Measured, Wrong, reordered, repaired, rewritten, shifted, swapped, wrong_readings

from calib_core.captures.content import read_points, sphere_of
from calib_core.captures.observe import observe_capture
from calib_core.causes.apply import applied, changes_for
from calib_core.causes.poses import pose_causes
from calib_core.causes.scales import SeenArcs, scale_causes
from calib_core.causes.search import Posed, best_starts, cost_of, misfits_mm
from calib_core.causes.table import table_causes
from calib_core.chain.observations import SphereObservation, SphereSize, TableObservation
from calib_core.chain.start import centers_of
from calib_core.errors import InputError
from calib_core.findings import causes_of
from calib_core.frames import RigidTransform
from calib_core.records import RootCause, Session
from calib_core.robots import parse_pose
from calib_core.simulation import SimulatedSession, simulate

_TOLD_APART = 6.0  # of the summed costs: what one capture that fits nowhere adds


def run(full: bool) -> list[Row]:
    """Return the figures; in full every wrong reading on every cell, otherwise every eleventh."""
    cases = list(wrong_readings())
    rows: list[Row] = []
    for name, cells in sets(full):
        picked = cases if full else cases[:: 11 if name == "simulated" else 23]
        rows += readings(name, cells, picked)
        rows += orders(name, cells, (30 if full else 4) if name == "simulated" else (10 if full else 2))
    rows += [scales(full), angles(range(20 if full else 2)), right(range(200 if full else 12))]
    rows.append(right_lengths(range(200 if full else 4)))
    return rows


def scales(full: bool) -> Row:
    """Scaled profiles and other diameters: the right cause first; simulated cells and both real sets."""
    missed: list[str] = []
    untold: list[str] = []
    count = 0
    sessions = [(f"simulated {n}", *_simulated_files(n)) for n in range(8 if full else 1)]
    if DATA.is_dir():
        sessions += [(name, *_real_files(name)) for name in SETS]
    for name, session, files in sessions:
        sphere = sphere_of(session.cell, session.captures)
        diameter = sphere.diameter_mm
        for x, z in SCALES if full else SCALES[::3]:
            wrong_files = scaled_files(files, x, z)
            found = causes_of(scale_causes(session, session.captures, wrong_files.__getitem__, sphere))
            settings = found[0].point_settings if found else {}
            right = [abs(settings.get(f"{axis}_scale", 1.0) * s - 1) < 0.02 for axis, s in (("x", x), ("z", z))]
            count += 1
            if not (all(right) and settings):
                told = settings.get("x_scale", 1.0), settings.get("z_scale", 1.0)
                odds = log_odds(session, wrong_files, (1 / x, 1 / z), sphere, told, sphere)
                (missed if odds > _TOLD_APART else untold).append(
                    f"{name} x {x:g} z {z:g}: {settings or 'nothing'} ({odds:+.0f})"
                )
        for wrong in (0.9, 1.2, 0.5):
            told = SphereSize(wrong * diameter, sphere.sigma_mm)
            found = causes_of(scale_causes(session, session.captures, files.__getitem__, told))
            cell = found[0].changes.cell if found and found[0].changes else {}
            count += 1
            if not abs(cell.get("sphere_diameter_mm", 0.0) / diameter - 1) < 0.02:
                named = SphereSize(cell.get("sphere_diameter_mm", told.diameter_mm), sphere.sigma_mm)
                odds = log_odds(session, files, (1.0, 1.0), sphere, (1.0, 1.0), named)
                what = f"{name} diameter {told.diameter_mm:g}: {found[0].id if found else 'nothing'} ({odds:+.0f})"
                (missed if odds > _TOLD_APART else untold).append(what)
    told_count = count - len(untold)
    text = f"{told_count - len(missed)} of {told_count}" + (f"; missed {'; '.join(missed)}" if missed else "")
    text += f"; cannot be told: {len(untold)}" + (f" ({'; '.join(untold)})" if untold else "")
    return Row(
        "scaled profiles, other diameters: right cause first, of those that can be told",
        "≥ 98 %",
        text,
        len(missed) <= 0.02 * told_count,
    )


def log_odds(
    session: Session,
    files: dict[str, bytes],
    true: tuple[float, float],
    sphere: SphereSize,
    named: tuple[float, float],
    named_sphere: SphereSize,
) -> float:
    """Return by how much the truth is likelier than what was named, as one who has it can tell.

    A profile likelihood over the sphere's centres: normal, their scatter unknown.
    """
    points = {c.id: read_points(c, files.__getitem__) for c in session.captures}
    scatters: list[float] = []
    for (x, z), size in ((true, sphere), (named, named_sphere)):
        seen = SeenArcs.of(session, session.captures, points, x / z)
        scatters.append(np.inf if seen is None else seen.scatter_mm(z, z, size))
    freedom = 3 * len(session.captures) - 9
    return float(freedom * np.log(scatters[1] / scatters[0])) if np.isfinite(scatters[0]) else -np.inf


def angles(seeds: range) -> Row:
    """Wrong table angles: the right cause, and the angles fit once it is applied."""
    right = 0
    missed: list[str] = []
    for seed in seeds:
        table = simulate("turntable", seed)
        turned = [c for c in table.session.captures if c.step == "turntable"]
        spheres = [observe_capture(table.session, c, table.files.__getitem__) for c in turned]
        for name, wrong in ANGLES.items():
            session = told_angles(table.session, wrong)
            found = _of_table(table, session, spheres)
            good = False
            if found:
                mended, _ = applied(session, changes_for(session, found[0]))
                sense = -1 if "other way" in name else 1
                pairs = zip(mended.captures, table.session.captures, strict=True)
                off = [sense * (a.table_deg or 0) - b.table_deg for a, b in pairs if b.table_deg is not None]
                good = bool(np.ptp(off) < 0.3 or abs(np.ptp(off) - 360) < 0.3)
            right += good
            missed += [] if good else [f"{seed} {name}: {found[0].id if found else 'nothing'}"]
    count = len(seeds) * len(ANGLES)
    text = f"{right} of {count}" + (f"; missed {'; '.join(missed)}" if missed else "")
    return Row("wrong table angles: right cause first and Apply repairs", "≥ 98 %", text, right >= 0.98 * count)


def right_lengths(seeds: range) -> Row:
    """Lengths and table angles of right sessions, looked at although nothing makes them doubtful."""
    said: list[str] = []
    for seed in seeds:
        session, files = _simulated_files(seed)
        sphere = sphere_of(session.cell, session.captures)
        said += [c.id for c in causes_of(scale_causes(session, session.captures, files.__getitem__, sphere))]
        if seed % 4 == 0:
            table = simulate("turntable", seed)
            turned = [c for c in table.session.captures if c.step == "turntable"]
            spheres = [observe_capture(table.session, c, table.files.__getitem__) for c in turned]
            said += [c.id for c in _of_table(table, table.session, spheres)]
    return Row(
        f"{len(seeds)} right sessions: lengths or table angles said", "0", f"{len(said)} {said[:3]}", not said
    )


def _of_table(table: SimulatedSession, session: Session, spheres: list[SphereObservation]) -> list[RootCause]:
    tool = RigidTransform(np.array(table.truth["tool0_from_laser"]), "tool0", "laser")
    turned = [c for c in session.captures if c.step == "turntable"]
    told = [
        TableObservation(o, float(np.deg2rad(c.table_deg or 0.0)), c.mount or "")
        for c, o in zip(turned, spheres, strict=True)
    ]
    return causes_of(table_causes(session.captures, told, sphere_of(session.cell, turned), tool))


def _simulated_files(seed: int) -> tuple[Session, dict[str, bytes]]:
    simulated = Cell.of("tcp", seed).simulated
    return simulated.session, dict(simulated.files)


def _real_files(name: str) -> tuple[Session, dict[str, bytes]]:
    folder = DATA / name
    session = real(name).session
    return session, {file: (folder / file).read_bytes() for c in session.captures for file in c.files}


def sets(full: bool) -> list[tuple[str, list[Measured]]]:
    found = [("simulated", [simulated(seed) for seed in range(8 if full else 3)])]
    if DATA.is_dir():
        found += [(name, [real(name)]) for name in SETS]
    return found


def simulated(seed: int) -> Measured:
    cell = Cell.of("tcp", seed)
    return Measured(cell.simulated.session, cell.observations, sphere_of(cell.simulated.session.cell, []))


def real(name: str) -> Measured:
    import json

    from calib_core.captures.observe import observe_capture
    from calib_core.records import parse_session

    folder = DATA / name
    session = parse_session(json.loads((folder / "session.json").read_text(encoding="utf-8")))
    used = [c for c in session.captures if c.step == "tcp" and not c.excluded]
    session = session.model_copy(update={"captures": used})
    read = lambda file: (folder / file).read_bytes()  # noqa: E731
    return Measured(session, [observe_capture(session, c, read) for c in used], sphere_of(session.cell, used))


def readings(name: str, cells: list[Measured], cases: list[Wrong]) -> list[Row]:
    judged: Counter[str] = Counter()
    untold: list[str] = []
    missed: list[str] = []
    for number, case in enumerate(cases):
        cell = cells[number % len(cells)]
        session = rewritten(cell.session, case.told, case.written)
        verdict = judgement(cell, session)
        judged[verdict] += 1
        if verdict == "cannot be told":
            untold.append(case.name)
        elif verdict != "right":
            missed.append(f"{case.name}: {verdict}")
    told = judged.total() - judged["cannot be told"]
    share = judged["right"] / max(told, 1)
    text = f"{judged['right']} of {told}" + (f"; missed {'; '.join(missed)}" if missed else "")
    listed = f"{len(untold)} of {len(cases)}" + (f": {', '.join(untold)}" if untold else "")
    return [
        Row(
            f"{name}: {len(cases)} wrong readings, right cause first and Apply repairs",
            "≥ 98 %",
            text,
            share >= 0.98,
        ),
        Row(f"{name}: wrong readings that cannot be told", "≤ 5 %", listed, len(untold) <= 0.05 * len(cases)),
    ]


def orders(name: str, cells: list[Measured], count: int) -> list[Row]:
    rows: list[Row] = []
    for what, draw in (("swapped", swapped), ("shifted", shifted)):
        rng = np.random.default_rng(13)
        judged: Counter[str] = Counter()
        for number in range(count):
            cell = cells[number % len(cells)]
            session = reordered(cell.session, draw(len(cell.observations), rng))
            judged[judgement(cell, session)] += 1
        told = count - judged["cannot be told"]
        text = f"{judged['right']} of {told}, {judged['cannot be told']} cannot be told"
        rows.append(Row(f"{name}: {count} with {what} poses", "≥ 98 %", text, judged["right"] >= 0.98 * told))
    return rows


def judgement(cell: Measured, session: Session) -> str:
    """Return whether the first cause is right, by the poses after Apply; or what else is the matter."""
    causes = causes_of(pose_causes(session.cell, session.captures, cell.observations, cell.sphere))
    if causes:
        after, _ = applied(session, changes_for(session, causes[0]))
        if repaired(after, cell.poses):
            return "right"
    if not told_apart(cell, session):
        return "cannot be told"
    return f"said {causes[0].id}" if causes else "nothing said"


def told_apart(cell: Measured, session: Session) -> bool:
    """Return whether one who has the true poses sees that they fit the captures better than the recorded ones."""
    try:
        recorded = [parse_pose(session.cell.pose_convention, c.pose or []) for c in session.captures]
    except InputError:
        return True
    everyone = np.ones(len(recorded), dtype=bool)
    both = [Posed(cell.poses, everyone), Posed(recorded, everyone)]
    centers = centers_of(cell.observations, cell.sphere)
    starts = best_starts(centers, both, 2)
    scale = max(0.05, starts[0].scatter_mm)
    true, other = (
        float(cost_of(np.diag(misfits_mm(both[h].centers(centers), starts[h])), scale).sum()) for h in (0, 1)
    )
    return other - true > _TOLD_APART


def right(seeds: range) -> Row:
    said = 0
    for seed in seeds:
        cell = simulated(seed)
        said += bool(
            causes_of(pose_causes(cell.session.cell, cell.session.captures, cell.observations, cell.sphere))
        )
    return Row(f"{len(seeds)} right sessions: a cause said", "0", f"{said}", said == 0)
