"""Errors: need, got, what to do; the finest place known is kept."""

import pytest

from calib_core import errors
from calib_core.errors import CalibrationError, InputError, MotionError

KINDS = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, CalibrationError)]


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_an_error_is_a_sentence_that_ends_with_what_to_do(kind: type[CalibrationError]) -> None:
    error = kind("a pose of 6 numbers", "5 numbers", "Add the missing number.", "p05")
    assert str(error) == "p05: need a pose of 6 numbers, got 5 numbers. Add the missing number."
    assert (error.need, error.got, error.to_do, error.where) == (
        "a pose of 6 numbers",
        "5 numbers",
        "Add the missing number.",
        "p05",
    )


def test_without_a_place_the_sentence_begins_with_the_need() -> None:
    assert str(InputError("a file", "a folder", "Name a file.")) == "need a file, got a folder. Name a file."


def test_codes_and_statuses_tell_the_kinds_apart() -> None:
    assert len({kind.code for kind in KINDS}) == len(KINDS)
    assert {kind.status for kind in KINDS} == {404, 409, 413, 422, 503}


def test_at_gives_a_place_to_an_error_that_has_none() -> None:
    error = MotionError("a", "b", "C.").at("session.json")
    assert type(error) is MotionError
    assert error.where == "session.json"
    assert (error.need, error.got, error.to_do) == ("a", "b", "C.")


def test_at_keeps_the_finer_place_and_does_not_say_one_twice() -> None:
    fine = InputError("a", "b", "C.", "p05")
    assert fine.at("session.json").where == "session.json: p05"
    assert fine.at("session.json").at("session.json").where == "session.json: p05"
    assert fine.at("p05").where == "p05"
    assert fine.where == "p05"


def test_an_error_survives_the_way_between_processes() -> None:
    import pickle

    error = pickle.loads(pickle.dumps(InputError("a", "b", "C.", "p05")))
    assert type(error) is InputError
    assert str(error) == "p05: need a, got b. C."
