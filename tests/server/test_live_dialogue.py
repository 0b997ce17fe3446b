"""The dialogue with robot programs, without a line: what is whole, what it says, what is answered."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from calib_core.errors import InputError
from server.live.dialogue import (
    LONGEST_ANSWER,
    LONGEST_MESSAGE,
    Answer,
    next_message,
    parse_message,
    pose_of,
    refusal,
)

EKI = b'<Robot><Capture>p07</Capture><Pos X="1.5" Y="2" Z="3" A="10" B="20" C="30"/><Table>45.0</Table></Robot>'


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(
    ("convention", "text", "numbers"),
    [
        ("fanuc", "p07 -195.8 1363.305 524.812 -179.9 0.889 9.6", [-195.8, 1363.305, 524.812, -179.9, 0.889, 9.6]),
        ("kuka", "p07 {X 1.5,Y 2.0,Z 3.0,A 10.0,B 20.0,C 30.0}", [1.5, 2, 3, 10, 20, 30]),
        ("abb", "p07 [[1.5,2,3],[1,0,0,0]]", [1.5, 2, 3, 1, 0, 0, 0]),
        ("ur", "p07 p[0.1, 0.2, 0.3, 0.0, 0.0, 1.5]", [0.1, 0.2, 0.3, 0, 0, 1.5]),
        ("yaskawa", "p07 1.5,2,3,10,20,30", [1.5, 2, 3, 10, 20, 30]),
        ("kuka", EKI.decode(), [1.5, 2, 3, 10, 20, 30]),
    ],
)  # fmt: skip
def test_a_pose_is_read_as_its_brand_writes_it(convention: str, text: str, numbers: list[float]) -> None:
    message = parse_message(text)
    assert message.capture == "p07"
    pose = pose_of(message, convention)
    assert pose is not None
    assert pose[0] == pytest.approx(numbers)


def test_fields_beside_the_pose_are_taken() -> None:
    message = parse_message("t03 1 2 3 0 0 0 step=turntable table=45.5 mount=low tool=2 frame=Base")
    assert message.fields == {
        "step": "turntable", "table_deg": 45.5, "mount": "low", "active_tool": 2, "active_frame": "Base",
    }  # fmt: skip
    assert message.pose == "1 2 3 0 0 0"
    assert parse_message(EKI.decode()).fields == {"table_deg": 45.0}
    assert parse_message("done").action == "done"
    assert parse_message('<Scancell Done="1"/>').action == "done"
    assert parse_message('<Scancell Token="scancell_x"/>').capture == "scancell_x"


def test_an_element_needs_no_end_of_line_and_may_come_in_pieces() -> None:
    for cut in range(1, len(EKI)):
        assert next_message(EKI[:cut]) is None
    assert next_message(EKI + b"<Ro") == (EKI.decode(), b"<Ro")
    assert next_message(b'\r\n<S Done="1"/>done\r\n') == ('<S Done="1"/>', b"done\r\n")
    assert next_message(b"p07 1 2\r\np08") == ("p07 1 2", b"\r\np08")
    assert next_message(b"p07 1 2") is None


@pytest.mark.parametrize(
    "text",
    [
        "", "-", "p07/../x 1 2 3", "<a", "<a><b></a>", '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "<a/>", "\x00",
        "p07 table=x",
    ],
)  # fmt: skip
def test_what_is_no_message_is_refused(text: str) -> None:
    with pytest.raises(InputError):
        parse_message(text)


def test_a_message_that_does_not_end_is_refused() -> None:
    for start in (b"p07 ", b"<a>"):
        with pytest.raises(InputError, match="at most"):
            next_message(start + b"1" * LONGEST_MESSAGE + b"\r\n</a>")


@given(st.binary(max_size=300))
def test_no_bytes_break_the_dialogue(received: bytes) -> None:
    rest = received
    while (found := next_message(rest)) is not None:
        text, rest = found
        try:
            message = parse_message(text)
            pose_of(message, "fanuc")
        except InputError as error:
            line = refusal(error).line()
            assert line.isascii()
            assert len(line) <= LONGEST_ANSWER


def test_answers_are_short_and_ascii() -> None:
    assert Answer(True, "good", "p07", 0.7134).line() == "OK p07 good 0.71"
    assert (
        Answer(True, "good", "p07", 0.7134).element() == '<Answer Ok="1" Capture="p07" Text="good" Zone="0.71"/>'
    )
    error = InputError("a good arc", "arc too short", "Move 12 mm to −x.")
    assert refusal(error).line() == "NO arc too short, move 12 mm to -x"
    assert refusal(error, "p07").to_bytes(True) == (
        b'<Answer Ok="0" Capture="p07" Text="arc too short, move 12 mm to -x"/>\r\n'
    )
    assert len(Answer(False, "word " * 100).line()) <= LONGEST_ANSWER
