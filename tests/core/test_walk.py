"""The way from a scanner to its ball: whatever carries them, the ball moves in L as the geometry says."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib_core.cell.layout import AxisState, Carrier, Layout, MovedAxis
from calib_core.cell.walk import Carriers, Position, Walk, ways
from calib_core.frames import RigidTransform, rotation_from_vector

EVERY: list[tuple[Carrier, str]] = [("tool0", "base"), ("base", "tool0"), ("base", "base"), ("tool0", "tool0")]
MOUNTS: tuple[Carrier, ...] = ("tool0", "base")
AXES = (
    MovedAxis("rail", "linear", "robot"),
    MovedAxis("tilt"),
    MovedAxis("turn", on="tilt"),
    MovedAxis("slide", "linear", on="turn"),
    MovedAxis("other table"),
    MovedAxis("waist", "rotary", "robot"),
)


def pose(seed: int) -> RigidTransform:
    rng = np.random.default_rng(seed)
    return RigidTransform.of(rng.uniform(-1, 1, 3), rng.uniform(-500, 500, 3), "base", "tool0")


def walk_of(
    layout: Layout, poses: list[RigidTransform], scanner: list[int], place: list[int], readings: object
) -> Walk:
    carriers = [Carriers(layout.mounts[s][1], layout.places[p][0]) for s, p in zip(scanner, place, strict=True)]
    table = np.array(readings, dtype=float).reshape(len(poses), len(layout.axes))
    return ways(layout, poses, carriers, np.array(scanner), np.array(place), table)


def position_of(layout: Layout, seed: int) -> Position:
    rng = np.random.default_rng(seed)
    mounts = [pose(seed + 1 + n) for n in range(len(layout.mounts))]
    axes = [
        AxisState(pose(seed + 20 + n).rotation, rng.uniform(-300, 300, 3), 1.01) for n in range(len(layout.axes))
    ]
    return Position(
        np.array([m.rotation for m in mounts]),
        np.array([m.translation_mm for m in mounts]),
        rng.uniform(-200, 200, (len(layout.places), 3)),
        tuple(axes),
    )


def seen_by_matrices(walk: Walk, at: Position, k: int) -> np.ndarray:
    """Where a capture sees its ball, by 4×4 matrices one after the other."""
    layout = walk.layout

    def motion(a: int) -> np.ndarray:
        axis, reading = at.axes[a], at.axes[a].scale * walk.readings[k, a]
        moved = np.eye(4)
        if layout.axes[a].kind == "linear":
            moved[:3, 3] = reading * axis.rotation[:, 2]
        else:
            moved[:3, :3] = rotation_from_vector(reading * axis.rotation[:, 2])
            moved[:3, 3] = axis.origin - moved[:3, :3] @ axis.origin
        return moved

    def product(names: list[int]) -> np.ndarray:
        out = np.eye(4)
        for a in names:
            out = out @ motion(a)
        return out

    robots = [a for a, axis in enumerate(layout.axes) if axis.carries == "robot"]
    flange = np.eye(4)
    flange[:3, :3], flange[:3, 3] = walk.rotations[k], walk.translations[k]
    flange = product(robots) @ flange
    carrier, _ = layout.places[walk.place[k]]
    point = np.array([*at.places[walk.place[k]], 1.0])
    if carrier == "tool0":
        point = flange @ point
    elif carrier != "base":
        names = [axis.name for axis in layout.axes]
        own = names.index(carrier)
        if layout.axes[own].kind == "rotary":
            point[:3] = at.axes[own].rotation @ point[:3] + at.axes[own].origin
        while carrier in names:
            point = motion(names.index(carrier)) @ point
            carrier = layout.axes[names.index(carrier)].on
    s = walk.scanner[k]
    mount = np.eye(4)
    mount[:3, :3], mount[:3, 3] = at.mount_rotations[s], at.mount_translations[s]
    ground_from_laser = flange @ mount if layout.mounts[s][1] == "tool0" else mount
    return (np.linalg.inv(ground_from_laser) @ point)[:3]


@st.composite
def cells(draw: st.DrawFn) -> tuple[Walk, Position]:
    axes = tuple(a for a in AXES if draw(st.booleans()))
    carriers = ["base", "tool0", *(a.name for a in axes if a.carries == "object")]
    places = tuple(
        (c, f"{n}") for n, c in enumerate(draw(st.lists(st.sampled_from(carriers), min_size=1, max_size=4)))
    )
    ends: list[Carrier] = draw(st.lists(st.sampled_from(MOUNTS), min_size=1, max_size=3))
    mounts = tuple((f"{n}", carrier) for n, carrier in enumerate(ends))
    layout = Layout(mounts, places, axes)
    count, seed = 5, draw(st.integers(0, 999))
    rng = np.random.default_rng(seed)
    scanner, place = rng.integers(len(mounts), size=count).tolist(), rng.integers(len(places), size=count).tolist()
    readings = [
        [rng.uniform(-200, 200) if a.kind == "linear" else rng.uniform(-3, 3) for a in axes] for _ in range(count)
    ]
    return walk_of(layout, [pose(seed + k) for k in range(count)], scanner, place, readings), position_of(
        layout, seed
    )


@pytest.mark.thorough
@given(cells())
@settings(max_examples=60, deadline=None)
def test_balls_are_seen_where_matrices_put_them_and_move_as_the_derivatives_say(
    cell: tuple[Walk, Position],
) -> None:

    walk, at = cell
    seen = walk.seen(at)
    for k in range(len(seen)):
        if walk.over_robot[k] or walk.layout.mounts[walk.scanner[k]][1] == "base":
            assert seen[k] == pytest.approx(seen_by_matrices(walk, at, k), abs=1e-7)
    _, moves, levers = walk.balls(at)
    if moves is None or levers is None:
        return
    for p in range(walk.layout.unknowns):
        step = np.zeros(walk.layout.unknowns)
        step[p] = 1e-5
        ahead, behind = (walk.balls(at.moved(walk.layout, sign * step))[0] for sign in (1, -1))
        assert moves[:, :, p] == pytest.approx((ahead - behind) / 2e-5, rel=1e-5, abs=2e-4)
    for a in range(len(walk.layout.axes)):
        nudge = np.zeros_like(walk.readings)
        nudge[:, a] = 1e-5
        ahead, behind = (replace(walk, readings=walk.readings + sign * nudge).balls(at)[0] for sign in (1, -1))
        assert at.axes[a].scale * levers[:, :, a] == pytest.approx((ahead - behind) / 2e-5, rel=1e-5, abs=2e-4)


@pytest.mark.parametrize(("scanner", "ball"), EVERY)
@pytest.mark.parametrize(
    "axes", [(), (MovedAxis("rail", "linear", "robot"), MovedAxis("waist", "rotary", "robot"))]
)
def test_a_pose_that_is_off_moves_the_ball_as_levers_and_axes_say(
    scanner: Carrier, ball: str, axes: tuple[MovedAxis, ...]
) -> None:
    layout = Layout((("", scanner),), ((ball, ""),), axes)
    reported, at = [pose(seed) for seed in range(5)], position_of(layout, 3)
    readings = [[120.0 * k, 0.3 * k][: len(axes)] for k in range(5)]
    walk = walk_of(layout, reported, [0] * 5, [0] * 5, readings)
    expected = walk.seen(at)
    moves = walk.moves(walk.laser_from_base(at), walk.levers(at, expected))
    shift, turn = np.array([0.02, -0.03, 0.01]), np.array([1e-5, -2e-5, 3e-5])
    true = [
        RigidTransform.of(rotation_from_vector(turn) @ one.rotation, one.translation_mm - shift, "base", "tool0")
        for one in reported
    ]
    moved = walk_of(layout, true, [0] * 5, [0] * 5, readings).seen(at) - expected
    assert moved == pytest.approx(moves @ np.array([*shift, *turn]), abs=3e-6)
    assert (Carriers(scanner, ball).over_robot != 0) == bool(np.abs(moved).max() > 1e-3)
    aside = replace(at, places=at.places + np.array([1.0, -2.0, 3.0]))
    turned = walk.ball_from_mount(at) @ at.mount_rotations[walk.scanner]
    apart = np.einsum("kij,kj->ki", turned, walk.seen(aside) - expected)
    assert apart == pytest.approx(np.tile([1.0, -2.0, 3.0], (5, 1)), abs=1e-9)
