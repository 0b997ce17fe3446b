"""A cell's frames as a graph: what follows from its edges, and how well it is known."""

from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib_core.errors import ConflictError, InputError, NotFoundError
from calib_core.frame_graph import FrameEdge, FrameGraph
from calib_core.frames import Frame, RigidTransform
from calib_core.records import Known, Scanner, Session
from calib_core.review.cell_frames import frame_graph, session_frames

_STEP = 1e-6


@pytest.mark.parametrize(
    "asked", [("turntable", "laser"), ("laser", "turntable"), ("base", "laser"), ("tool0", "base")]
)
@settings(max_examples=20)  # each draws its own transforms, and its own 324 numbers
@given(seed=st.integers(0, 2**31))
def test_covariance_is_that_of_the_edges_with_what_they_share(asked: tuple[str, str], seed: int) -> None:
    """Held against differences of the product itself, whichever way each edge is passed."""
    random = np.random.default_rng(seed)
    names: list[tuple[Frame, Frame]] = [("base", "tool0"), ("tool0", "laser"), ("base", "turntable")]
    transforms = [RigidTransform.of(random.normal(size=3), 100 * random.normal(size=3), *name) for name in names]
    root = random.normal(size=(18, 18))
    joint = root @ root.T
    joint[:6, 6:] = joint[6:, :6] = 0  # the robot's pose shares nothing with the answer

    def graph(change: np.ndarray) -> FrameGraph:
        moved = [t.perturbed(change[6 * k : 6 * k + 6]) for k, t in enumerate(transforms)]
        edges = [
            FrameEdge(*name, "solved", "chain", t, joint[6 * k : 6 * k + 6, 6 * k : 6 * k + 6])
            for k, (name, t) in enumerate(zip(names, moved, strict=True))
        ]
        return FrameGraph(edges, {("tool0_from_laser", "base_from_turntable"): joint[6:12, 12:]})

    found = graph(np.zeros(18)).find(*asked)
    columns = [
        found.transform.difference(graph(_STEP * unit).find(*asked).transform) / _STEP for unit in np.eye(18)
    ]
    jacobian = np.transpose(columns)
    expected = jacobian @ joint @ jacobian.T
    assert np.allclose(found.covariance, expected, atol=1e-4 * np.abs(expected).max())


def test_a_frame_to_itself_is_known_exactly() -> None:
    found = FrameGraph([]).find("base", "base")
    assert np.array_equal(found.transform.matrix, np.eye(4))
    assert not found.covariance.any()


def test_what_does_not_follow_is_said_with_what_would_help() -> None:
    graph = FrameGraph(
        [FrameEdge("tool0", "laser", "sought", "tcp"), FrameEdge("base", "tool0", "measured", "captures")]
    )
    with pytest.raises(ConflictError, match=r"tool0_from_laser, which is not determined.*Solve the stage 'tcp'"):
        graph.find("tool0", "laser")
    with pytest.raises(ConflictError, match="Name the capture"):
        graph.find("tool0", "base")
    with pytest.raises(ConflictError, match="transforms that lead from board to base"):
        graph.find("base", "board")
    with pytest.raises(InputError, match="frame: need one of"):
        graph.find("base", "flange")


def test_the_scanner_on_the_table_is_what_the_chain_says(
    turntable_results: tuple[Session, dict[str, dict[str, Any]]],
) -> None:
    session, results = turntable_results
    capture = next(one for one in session.captures if one.step == "turntable")
    found = session_frames(session, results, asked=("turntable", "laser"), capture=capture.id)
    graph = frame_graph(session, results, capture=capture.id)
    by_hand = (
        RigidTransform.from_rounded(results["chain"]["base_from_turntable"], "base", "turntable").inverse()
        @ graph.find("base", "tool0").transform
        @ RigidTransform.from_rounded(results["chain"]["tool0_from_laser"], "tool0", "laser")
    )
    assert found.asked is not None
    assert np.allclose(found.asked.matrix, by_hand.matrix)
    assert found.asked.through == ["base_from_turntable", "base_from_tool0", "tool0_from_laser"]
    assert not found.asked.without_covariance
    # Tool and table err together: what they share counts, and here it makes the scanner better known on the table.
    apart = FrameGraph(graph.edges).find("turntable", "laser").covariance
    assert np.trace(np.array(found.asked.covariance)[3:, 3:]) < np.trace(apart[3:, 3:])
    assert {edge.source for edge in found.edges if edge.state == "solved"} == {"chain"}


@pytest.mark.parametrize("named", [True, False])
def test_each_scanner_has_its_edge_and_the_one_that_saw_is_solved(
    turntable_results: tuple[Session, dict[str, dict[str, Any]]], named: bool
) -> None:
    session, results = turntable_results
    scanners = {"left": Scanner(), "right": Scanner()} if named else None
    seen = [one.model_copy(update={"scanner": "right"}) for one in session.captures]
    session = session.model_copy(
        update={"cell": session.cell.model_copy(update={"scanners": scanners}), "captures": seen}
    )
    edges = [edge for edge in frame_graph(session, results).edges if edge.name == "tool0_from_laser"]
    states = {edge.scanner: edge.state for edge in edges}
    assert states == {"right": "solved", "left": "sought"} if named else {"right": "solved"}
    assert edges[0].scanner == "right"


def test_known_transforms_need_no_stage_and_a_stale_one_says_so(
    turntable_results: tuple[Session, dict[str, dict[str, Any]]],
) -> None:
    session, results = turntable_results
    tool = results["tcp"]["tool0_from_laser"]
    known = session.model_copy(
        update={"cell": session.cell.model_copy(update={"known": Known(tool0_from_laser=tool)})}
    )
    assert frame_graph(known, {}).find("tool0", "laser").without_covariance == ("tool0_from_laser",)
    stale = session_frames(session, results, ["chain"], ("tool0", "laser"))
    assert stale.asked is not None
    assert stale.asked.stale
    with pytest.raises(NotFoundError, match="a capture of the session"):
        session_frames(session, results, capture="nothing")


def test_every_frame_can_be_asked_for() -> None:
    for frame in get_args(Frame):
        assert FrameGraph([]).find(frame, frame).through == ()
