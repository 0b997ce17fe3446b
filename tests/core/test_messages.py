"""Messages: what a text was made of is found again by its English words, and an empty text by nothing."""

from calib_core.messages import made_lately, message, sentences


def test_a_message_is_found_by_its_english_text() -> None:
    said = message("moved by {shift_mm:.1f} mm", shift_mm=0.25)
    found = made_lately(str(said))
    assert found is not None
    assert (found.template, found.values) == (said.template, said.values)


def test_an_empty_text_is_nobodys() -> None:
    """Results would say other things of a process that had once joined no sentences."""
    assert sentences(["", ""]) == ""
    assert made_lately("") is None
