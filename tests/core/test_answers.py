"""Small sessions of every kind are answered as they were: what changes a number raises its stage's revision."""

from typing import Any

import pytest

from tests.answers import answers, differences, kept, plain, sessions


@pytest.mark.thorough(keep=32)
@pytest.mark.parametrize("name", sessions())
def test_a_session_is_answered_as_before(name: str) -> None:
    found = differences(kept(name), plain(answers(name)))
    to_do = "Where it is meant, raise the stage's method_revision and run `python -m tests.answers`."
    assert not found, f"{len(found)} values of '{name}' came out otherwise. {to_do}\n" + "\n".join(found[:20])


THEN: dict[str, Any] = {"results": {"tcp": {"covariance": [[4.0, 0.0], [0.0, 1e-9]], "verdict": "pass"}}, "n": 2}


@pytest.mark.parametrize(
    "now",
    [
        {"results": {"tcp": {"covariance": [[4.001, 0.0], [0.0, 1e-9]], "verdict": "pass"}}, "n": 2},
        {"results": {"tcp": {"covariance": [[4.0, 0.0], [0.0, 1e-9]], "verdict": "warn"}}, "n": 2},
        {"results": {"tcp": {"covariance": [[4.0, 0.0], [0.0]], "verdict": "pass"}}, "n": 2},
        {"results": {"tcp": {"covariance": [[4.0, 0.0], [0.0, None]], "verdict": "pass"}}, "n": 2},
        {"results": {"tcp": {"covariance": [[4.0, 0.0], [0.0, 1e-9]], "verdict": "pass"}}, "n": 3},
    ],
)
def test_a_change_is_seen(now: Any) -> None:
    assert len(differences(THEN, now)) == 1


def test_rounding_is_no_change() -> None:
    now = {"results": {"tcp": {"covariance": [[4.0001, 1e-12], [0.0, 0]], "verdict": "pass"}}, "n": 2}
    assert differences(THEN, now) == []
    assert plain(["lies at -0.00 mm", "-0.5", 1.00000001]) == ["lies at 0.00 mm", "-0.5", 1.0]
