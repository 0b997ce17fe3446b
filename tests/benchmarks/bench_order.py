"""Lists of poses in a wrong order: named first with what mends it; right lists: nothing named."""

import numpy as np
from harness import Row
from wrong_poses import Measured

from calib_core.captures.content import sphere_of
from calib_core.captures.observe import observe_capture
from calib_core.causes.apply import applied, changes_for
from calib_core.causes.poses import pose_causes
from calib_core.findings import causes_of
from calib_core.records import Changes, Session
from calib_core.simulation import TcpScenario, simulate_tcp

KINDS = ("names", "reversed", "shifted", "rotated", "mixed", "captures by names")


def wrong_order(kind: str, count: int, seed: int) -> list[int]:
    """Return the place of the pose that each capture gets."""
    places = list(range(count))
    draw = np.random.default_rng(seed)
    by_text = sorted(places, key=lambda k: str(k + 1))
    half = (count + 1) // 2
    return {
        "names": by_text,
        "captures by names": np.argsort(by_text).tolist(),
        "reversed": places[::-1],
        "shifted": [min(k + 1, count - 1) for k in places],
        "rotated": [(k + 1 + seed % (count - 1)) % count for k in places],
        "mixed": [*places[::2], *places[1::2]] if draw.random() < 0.5 else [
            k // 2 + (half if k % 2 else 0) for k in places
        ],
    }[kind]  # fmt: skip


def measured(seed: int) -> Measured:
    """Return a simulated session of 10 to 18 captures."""
    made = simulate_tcp(seed, TcpScenario(orientations=7 + seed % 9))
    session = made.session
    observations = [observe_capture(session, c, made.files.__getitem__) for c in session.captures]
    return Measured(session, observations, sphere_of(session.cell, session.captures))


def ordered(session: Session, places: list[int]) -> Session:
    """Return a session whose captures have other captures' poses."""
    poses = [capture.pose for capture in session.captures]
    ids = [capture.id for capture in session.captures]
    changes = {ids[k]: {"pose": poses[place]} for k, place in enumerate(places)}
    return applied(session, Changes(captures=changes))[0]


def mended(cell: Measured, places: list[int]) -> bool:
    """Return whether the first cause hands every pose that is left back to its capture."""
    wrong = ordered(cell.session, places)
    causes = causes_of(pose_causes(wrong.cell, wrong.captures, cell.observations, cell.sphere))
    if not causes or causes[0].changes is None:
        return False
    right = applied(wrong, changes_for(wrong, causes[0]))[0]
    pairs = zip(right.captures, cell.session.captures, strict=True)
    return all(mine.excluded or mine.pose == theirs.pose for mine, theirs in pairs)


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes the 40 cells and 300 right lists of the target."""
    cells, right = (40, 300) if full else (2, 6)
    hits = dict.fromkeys(KINDS, 0)
    for seed in range(1, cells + 1):
        cell = measured(seed)
        for kind in KINDS:
            hits[kind] += mended(cell, wrong_order(kind, len(cell.session.captures), seed))
    named = 0
    for seed in range(1001, 1001 + right):
        cell = measured(seed)
        named += bool(pose_causes(cell.session.cell, cell.session.captures, cell.observations, cell.sphere))
    total = cells * len(KINDS)
    need = int(np.ceil(0.95 * total))
    found = ", ".join(f"{kind} {count}" for kind, count in hits.items())
    count = sum(hits.values())
    return [
        Row("wrong order named first and mended", f"≥ {need} of {total}", f"{count} ({found})", count >= need),
        Row("right lists named", f"0 of {right}", str(named), named == 0),
    ]
