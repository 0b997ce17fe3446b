"""A stream that goes on while what it tells stands still: told within two seconds, and no capture is taken."""

import sys
from collections.abc import Iterable
from typing import Any, Literal

import bench_freshness
import numpy as np
import pytest
from faulty_robot import FAULTS, Fault

from calib_core.errors import ConflictError
from calib_core.frames import RigidTransform
from calib_core.sphere.arc import fit_arc
from calib_core.sphere.standstill import standstill
from server.live.agreement import Agreement
from server.live.exposures import Exposure
from server.live.freshness import Freshness
from server.live.recording import table_fields
from server.live.standstill import Rest, Rules
from server.live.stream_order import StreamOrder
from server.sources.device import Clock, Frame, Sample
from server.sources.rosbridge import TfChain
from tests.server.connected_device import connected
from tests.server.test_live_robot_sources import SENT, bridge, stamp


def pose(x_mm: float) -> RigidTransform:
    return RigidTransform.of([0.0, 0.0, 0.0], [x_mm, 0.0, 500.0], "base", "tool0")


def reasons(clock: Clock, told: Iterable[tuple[float, float | None, float]]) -> list[str]:
    """What is said of readings given as (host time, device time, x)."""
    watch = Freshness(clock)
    judged = [watch.judge(Sample(host_s, device_s, pose(x_mm))) for host_s, device_s, x_mm in told]
    return [one.why for one in judged]


def reasons_of_angles(host_s: np.ndarray, table_deg: np.ndarray) -> list[str]:
    """What is said of a table's angles, which come without stamps."""
    watch = Freshness("none")
    told = zip(host_s, table_deg, strict=True)
    return [watch.judge(Sample(at_s, table_deg=float(deg) % 360.0)).why for at_s, deg in told]


def at_50_hz(seconds: float) -> np.ndarray:
    return 100.0 + np.arange(0.0, seconds, 0.02)


@pytest.mark.parametrize("clock", ["every-reading", "on-change", "none"])
def test_a_robot_that_moves_stands_and_jitters_is_fresh(clock: Clock) -> None:
    rng = np.random.default_rng(3)
    host_s = at_50_hz(20.0)
    x_mm = np.where(host_s < 110.0, 200.0 * np.sin(host_s), 200.0 * np.sin(110.0))
    device_s = host_s - 7.0 - rng.uniform(0.0, 0.05, len(host_s))  # arrives up to 50 ms late
    stamps = {
        "every-reading": np.maximum.accumulate(device_s) + 1e-6 * np.arange(len(host_s)),
        "none": host_s * np.nan,
    }
    changed = np.concatenate([[True], np.diff(x_mm) != 0])
    stamps["on-change"] = np.maximum.accumulate(np.where(changed, host_s, 0.0))
    told = [None if np.isnan(s) else float(s) for s in stamps[clock]]
    assert set(reasons(clock, zip(host_s, told, x_mm, strict=True))) == {""}


def test_a_clock_that_stands_is_told_within_half_a_second_and_left_again() -> None:
    host_s = at_50_hz(3.0)
    stands = (host_s > 101.0) & (host_s < 102.0)
    device_s = np.where(stands, 101.0, host_s)
    found = reasons("every-reading", zip(host_s, device_s, host_s, strict=True))
    first = next(k for k, why in enumerate(found) if why)
    assert host_s[first] - 101.0 < 0.5
    assert "repeats one reading" in found[first]
    assert found[-1] == ""


def test_a_lag_and_a_slow_clock_are_told_within_two_seconds() -> None:
    host_s = at_50_hz(6.0)
    late_s = np.where(host_s > 103.0, np.maximum(host_s - 1.0, 103.0), host_s)
    slow_s = np.where(host_s > 103.0, 103.0 + 0.5 * (host_s - 103.0), host_s)
    for device_s in (late_s, slow_s):
        found = reasons("every-reading", zip(host_s, device_s, host_s, strict=True))
        assert not any(why for why, at_s in zip(found, host_s, strict=True) if at_s <= 103.0)
        assert any("late" in why for why, at_s in zip(found, host_s, strict=True) if at_s < 105.0)


def test_readings_that_arrive_together_are_of_one_program() -> None:
    sent_s = at_50_hz(1.0)
    arrived_s = np.ceil(sent_s / 0.2) * 0.2 + 1e-5 * np.arange(len(sent_s))
    x_mm = 1000.0 * (sent_s - 100.0)
    for clock, stamps in (("none", [None] * len(sent_s)), ("every-reading", list(sent_s))):
        assert set(reasons(clock, zip(arrived_s, stamps, x_mm, strict=True))) == {""}
    other_mm = np.where(np.arange(len(sent_s)) % 2, 500.0 - 0.7 * x_mm, x_mm)  # of another arm, that moves too
    told = reasons("none", zip(arrived_s, [None] * len(sent_s), other_mm, strict=True))
    assert any("two programs" in why for why in told)


def test_two_publishers_and_a_change_without_a_stamp_are_told() -> None:
    host_s = at_50_hz(1.0)
    both = np.where(np.arange(len(host_s)) % 2, 40.0, 0.0)
    assert any(
        "two programs" in why for why in reasons("none", zip(host_s, [None] * len(host_s), both, strict=True))
    )
    assert any("angle jumps by 40.0°" in why for why in reasons_of_angles(host_s, both))
    assert any("angle jumps by 1.5°" in why for why in reasons_of_angles(host_s, np.where(both, 0.7, 359.2)))
    there_and_back = np.array([0.0, 40.0, 0.0, 40.0])  # told once at each place, as it arrives
    assert not any(reasons_of_angles(np.arange(4) * 2.5, there_and_back))
    assert set(reasons_of_angles(host_s, np.where(both, 0.004, 359.998))) == {""}  # one that stands at zero
    assert set(reasons_of_angles(host_s, 30.0 * np.sin(host_s))) == {""}  # one that goes to and fro
    stands = np.full(len(host_s), 100.0)
    found = reasons("on-change", zip(host_s, stands, host_s, strict=True))
    assert "time stamp does not" in found[-1]


def test_streams_that_are_doubled_or_out_of_order_are_told_and_others_not() -> None:
    host_s = at_50_hz(1.0)
    x_mm = 200.0 * np.sin(3.0 * host_s)
    swapped = np.arange(len(x_mm))
    swapped[1:-1:2], swapped[2::2] = np.arange(2, len(x_mm), 2), np.arange(1, len(x_mm) - 1, 2)
    shaking = x_mm * 0.0 + 0.4 * (-1.0) ** np.arange(len(x_mm))

    def said(places_mm: np.ndarray, table: bool = False) -> str:
        order = StreamOrder()
        for at_s, place_mm in zip(host_s, places_mm, strict=True):
            angle, frame = (float(place_mm), None) if table else (None, pose(float(place_mm)))
            order.take(Sample(float(at_s), None, frame, table_deg=angle))
        assert order.said(float(host_s[-1]) + 60.0) == ""
        return order.said(float(host_s[-1]))

    for table in (False, True):
        assert said(x_mm, table) == said(x_mm * 0.0, table) == said(np.repeat(x_mm[::5], 5)) == ""
        assert "twice" in said(np.repeat(x_mm[::2], 2), table)
        assert "out of order" in said(x_mm[swapped], table)
    assert said(shaking) == ""


EACH: dict[str, Fault] = {
    "every-reading": "freeze",
    "on-change": "freeze",
    "none": "two publishers",
    "pose-lines": "reordered",
    "kuka-eki": "stale",
    "kuka-rsi": "freeze",
    "abb-egm": "late",
    "ur-rtde": "slow clock",
    "rosbridge": "two publishers",
    "opcua": "stale",
    "abb-rws": "late",
    "kukavarproxy": "freeze",
    "fanuc-curpos": "duplicated",
    "gocator": "late",
    "genicam": "stale",
    "image-stream": "late",
    "frame-folder": "late",
    "modbus": "two publishers",
}
"""One fault a source and one source a fault; `scancell bench freshness` tries all of them."""


def test_every_source_and_every_fault_is_tried() -> None:
    assert set(EACH) == set(bench_freshness.WAYS)
    assert set(EACH.values()) == set(FAULTS)


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("way", EACH)
def test_no_capture_has_a_wrong_pose_whatever_stands_between_controller_and_workbench(way: str) -> None:
    found = bench_freshness.trial(way, EACH[way], 2)
    assert found.wrong == 0
    assert found.said or EACH[way] in ("duplicated", "reordered")  # which tell no wrong pose


@pytest.mark.thorough
@pytest.mark.parametrize("clock", ["none", "on-change"])
def test_what_fell_silent_at_the_end_of_a_move_counts_no_longer_once_the_robot_goes_on(clock: Clock) -> None:
    found = bench_freshness.frozen_at_the_end(clock, 2)
    assert found.wrong == 0
    assert len(found.said) > 0
    assert "perhaps was not sent any more" in found.said[0]


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="no process is stopped there")
def test_what_nobody_looked_at_proves_no_standstill() -> None:
    """A host that let no thread run for seconds, as the robot went on, kept a pose that was 98 mm off."""
    found = bench_freshness.frozen_at_the_end("none", 4, held_up=True)
    assert found.wrong == 0
    assert any("held up" in why for why in found.said)


@pytest.mark.thorough
@pytest.mark.parametrize("which", bench_freshness.LATE)
def test_what_was_late_before_it_was_connected_takes_no_wrong_capture(which: Literal["robot", "scanner"]) -> None:
    assert bench_freshness.late_from_the_start(which, 3).wrong == 0


def test_an_exposure_that_arrives_late_is_marked() -> None:
    watch = Freshness("every-reading")
    told = [Frame(host_s, "a.csv", b"", host_s - (1.0 if host_s > 101.0 else 0.0)) for host_s in at_50_hz(3.0)]
    found = [watch.judge(frame) for frame in told]
    assert not any(judged.why for judged in found[:50])
    assert "late" in found[-1].why


def test_joints_that_turn_while_the_pose_stands_contradict_it() -> None:
    x = np.linspace(-12.0, 12.0, 60)
    points = np.column_stack([x, 200.0 - np.sqrt(20.0**2 - x**2)])
    arc = fit_arc(points + np.random.default_rng(3).normal(0.0, 0.005, points.shape), 80.0, "away")
    still = standstill([[arc] * 3])
    assert still is not None
    agreement = Agreement(Rules())

    def rest(turned_deg: float) -> Rest:
        sample = Sample(100.0, None, pose(0.0), (0.0, turned_deg, 0.0, 0.0, 0.0, 0.0))
        agreement.tell(sample)
        return Rest(sample, None, (Exposure(Frame(101.0, "a.csv", b""), points, arc),), still)

    assert agreement.contradiction(rest(0.0)) == ""
    assert agreement.contradiction(rest(0.1)) == ""
    assert "a joint turned by 20.0°" in agreement.contradiction(rest(20.0))


@pytest.mark.parametrize(
    ("robot_s", "scanner_s", "together"), [(0.0, 0.0, True), (1.0, 0.0, False), (0.0, 1.0, False)]
)
def test_pose_and_stripe_leave_together_only_where_neither_is_late(
    robot_s: float, scanner_s: float, together: bool
) -> None:
    """What is late from its start on has no clock that tells it."""
    x, agreement = np.linspace(-12.0, 12.0, 60), Agreement(Rules())
    for moment_s in np.arange(100.0, 104.0, 0.05):
        pose_mm, seen_mm = (
            float(np.clip(100.0 * (moment_s - by_s - 102.0), 0.0, 40.0)) for by_s in (robot_s, scanner_s)
        )
        points = np.column_stack([x + seen_mm, 200.0 - np.sqrt(20.0**2 - x**2)])
        agreement.tell(Sample(moment_s, None, pose(pose_mm)))
        agreement.see(Exposure(Frame(moment_s + 0.01, "a.csv", b""), points, fit_arc(points, 80.0, "away")))
    assert agreement.departures.together == ("robot" if together else None)


def test_a_pose_that_moves_while_the_stripe_stands_was_not_where_it_stood_before() -> None:
    """Of a source without a clock that is a second late: the stripe is at the next place already."""
    x = np.linspace(-12.0, 12.0, 60)
    points = np.column_stack([x, 200.0 - np.sqrt(20.0**2 - x**2)])
    agreement, arc = Agreement(Rules()), fit_arc(points, 80.0, "away")
    for number, moment_s in enumerate(np.arange(100.0, 103.0, 0.05)):
        agreement.tell(Sample(moment_s, None, pose(0.0 if moment_s < 101.5 else 50.0)))
        agreement.see(Exposure(Frame(moment_s + 0.01, f"{number}.csv", b""), points, arc))
        assert agreement.doubted_since_s == (None if moment_s < 101.8 else 100.0)
    assert not agreement.is_late()


@pytest.mark.parametrize(("deg_per_s", "late_s"), [(0.5, 0.0), (0.5, 0.2), (20.0, 0.2), (20.0, 1.0)])
def test_an_angle_that_turns_while_its_ball_stands_is_late(deg_per_s: float, late_s: float) -> None:
    """Exposures arrive late themselves, and a slow table moves the ball little by little."""
    x, agreement = np.linspace(-12.0, 12.0, 60), Agreement(Rules())
    for moment_s in np.arange(100.0, 106.0, 0.05):
        deg, seen_deg = (
            float(np.clip(deg_per_s * (moment_s - by_s - 102.0), 0.0, 2.0)) for by_s in (late_s, 0.25)
        )
        points = np.column_stack([x + 3.0 * seen_deg, 200.0 - np.sqrt(20.0**2 - x**2)])
        agreement.tell(Sample(moment_s, None, pose(0.0), table_deg=deg))
        arc = fit_arc(points, 80.0, "away")
        agreement.see(Exposure(Frame(moment_s + 0.01, "a.csv", b""), points, arc), is_on_table=True)
    assert ("arrive late" in agreement.late_angle.why) == (late_s == 1.0)


@pytest.mark.thorough
def test_joints_of_ros_that_stand_make_the_sample_as_old_as_they_are() -> None:
    joints = {"header": stamp(8), "name": ["a1"], "position": [0.5]}
    still = {"header": stamp(9), "pose": SENT["/pose"]["pose"]}
    with bridge({"/joint_states": joints, "/pose": still}) as url:
        device = connected("rosbridge", url=url, pose_topic="/pose", joints=["a1"])
        readings = [found for _ in range(4) if (found := device.read()) is not None]
        device.close()
    assert [reading.device_time_s for reading in readings] == [8.5]


@pytest.mark.thorough
def test_a_healthy_source_is_captured_at_every_place() -> None:
    found = bench_freshness.trial("every-reading", None, 2)
    assert (found.taken, found.wrong) == (2, 0)


def test_of_tf_the_oldest_link_of_the_chain_counts() -> None:
    """Others publish into /tf too: their stamps made a frozen flange look fresh."""
    chain = TfChain("base", "tool0")

    def link(parent: str, child: str, stamp_s: int) -> dict[str, Any]:
        still = {"translation": dict.fromkeys("xyz", 0.1), "rotation": {"x": 0, "y": 0, "z": 0, "w": 1}}
        header = {"frame_id": parent, "stamp": {"sec": stamp_s, "nanosec": 0}}
        return {"header": header, "child_frame_id": child, "transform": still}

    assert chain.hear([link("wrist", "tool0", 0)], is_static=True) is None
    links = [link("base", "rail", 11), link("rail", "wrist", 10), link("map", "camera", 99)]
    found = chain.hear(links, is_static=False)
    assert found is not None
    assert found[1] == 10.0
    assert chain.hear([link("map", "camera", 100)], is_static=False) is None  # it tells nothing of the flange
    found = chain.hear([link("base", "rail", 12)], is_static=False)
    assert found is not None
    assert found[1] == 10.0  # the wrist's publisher has stopped


def test_a_sweep_whose_table_was_not_heard_to_its_end_is_not_stored() -> None:
    """What repeats itself is passed over: one frozen in the middle of a scan was stored as the scan's."""
    told = [Sample(float(at_s), table_deg=30.0) for at_s in np.arange(100.0, 102.0, 0.05)]
    assert table_fields(told, Rules(), (100.0, 102.0)) == {"table_deg": 30.0}
    for heard in (told[:20], told[20:], [*told[:10], *told[25:]], []):
        with pytest.raises(ConflictError, match="gap"):
            table_fields(heard, Rules(), (100.0, 102.0))
    assert table_fields([], Rules(), None) == {}  # no table tells an angle


def test_a_robot_that_moves_and_tells_its_tables_angle_is_swept_on_the_move() -> None:
    """That it moves is said of the robot; only a table that is told alone says so of itself."""
    on_the_move = [Sample(100.0, None, pose(0.0), table_deg=30.0, moving=True)]
    assert table_fields(on_the_move, Rules(), None) == {"table_deg": 30.0}
    with pytest.raises(ConflictError, match="at rest"):
        table_fields([Sample(100.0, table_deg=30.0, moving=True)], Rules(), None)
