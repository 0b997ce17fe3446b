"""A session at hand keeps what it solved."""

import pytest

import calib_core as cc


def test_what_is_solved_is_kept_though_a_later_stage_is_refused() -> None:
    session, _ = cc.simulate("turntable", seed=3)
    turned = {name for capture in session.captures if capture.step == "turntable" for name in capture.files}
    read = session.read

    def spoiled(name: str) -> bytes:
        return b"no profile" if name in turned else read(name)

    session.read = spoiled
    with pytest.raises(cc.CalibrationError):
        session.run()
    assert list(session.results) == ["tcp"]
    assert session.results["tcp"].verdict == "pass"
