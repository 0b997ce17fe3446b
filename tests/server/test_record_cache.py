"""What was read from texts is kept while it is asked for: bounded by length, and let go of once nobody asks."""

import pytest

from server.store import sessions as kept_records
from server.store.sessions import KeptRecords


def test_a_text_is_read_once_while_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 0.0
    monkeypatch.setattr(kept_records.time, "monotonic", lambda: now_s)
    read: list[str] = []

    def make(text: str) -> list[str]:
        read.append(text)
        return [text]

    kept = KeptRecords(make, most_characters=100, rest_s=10.0)
    assert kept.of("one") is kept.of("one")
    now_s = 9.0
    kept.of("one")
    now_s = 18.0
    kept.of("two")  # "one" was asked for nine seconds ago
    assert (read, len(kept)) == (["one", "two"], 2)
    now_s = 28.5
    kept.of("three")
    assert len(kept) == 1
    kept.of("one")
    assert read == ["one", "two", "three", "one"]


def test_what_was_asked_for_longest_ago_goes_first() -> None:
    kept = KeptRecords(str.upper, most_characters=10, rest_s=1e9)
    for text in ("aaaa", "bbbb", "aaaa", "cccc"):  # twelve characters of three texts: "bbbb" has to go
        assert kept.of(text) == text.upper()
    assert len(kept) == 2
    kept.of("x" * 11)
    assert len(kept) == 0  # longer than all that may be kept
