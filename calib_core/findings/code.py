"""A code: how severe it is, what it says, and the page about it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from string import Formatter
from typing import Any, Final, cast

from calib_core.messages import ENGLISH, Catalogue, Message, Names, Value, data_of
from calib_core.records.causes import RootCause
from calib_core.records.findings import Finding, MessageParts, Severity, Told


@dataclass(frozen=True)
class Plural:
    """A text that differs with a count: the value `by`, or how many captures."""

    one: str
    many: str
    by: str = "captures"


Text = str | Plural
Choice = Text | Mapping[str, Text]


@dataclass(frozen=True)
class Code:
    """A code and all that is said of it; calling it makes a finding.

    Parameters
    ----------
    name : str
        Lower-case words with hyphens, never reused.
    severity : Severity
    text, to_do : str, Plural, or mapping
        What is said, and what to do; by the value named `by` where there are several.
    meaning, decided, usual_causes : str
        The page: what it means, how it is decided (limit, odds), what usually causes it.
    since : str
        The first version that gave it.
    by, by_to_do : str
        The name of the value that chooses among several texts; for what to do, where that is another one.
    reason : str
        What is said of a capture that is not used for it.
    title : str
        The headline of its remedy.
    fixed : bool
        Whether no cell may change its severity.
    behind : tuple of str
        The codes from which it only follows.
    explains_all : bool
        Whether all other errors and warnings only follow from it.
    led_by : tuple of str
        The codes of causes that stand before it although they are less severe: what happened, then what it did.
    """

    name: str
    severity: Severity
    text: Choice
    to_do: Choice = ""
    meaning: str = ""
    decided: str = ""
    usual_causes: str = ""
    since: str = "0.2"
    by: str = ""
    by_to_do: str = ""
    reason: Choice = ""
    title: Choice = ""
    fixed: bool = False
    behind: tuple[str, ...] = ()
    explains_all: bool = False
    led_by: tuple[str, ...] = ()

    def __call__(
        self,
        captures: Sequence[str] = (),
        *,
        where: str = "",
        behind: str | None = None,
        remedy: RootCause | None = None,
        each: Mapping[str, Mapping[str, Value]] | None = None,
        **values: Value,
    ) -> Finding:
        """Return a finding; where only `each` is given, its values are those of the first capture.

        `behind` is the code of another finding from which this one follows.
        """
        by_capture = {name: _told(some) for name, some in (each or {}).items()}
        first = next(iter((each or {}).values()), {})
        filled = {**first, **values}
        parts = {
            name: MessageParts(**data_of(value)) for name, value in filled.items() if isinstance(value, Message)
        } | {
            f"{capture}:{name}": MessageParts(**data_of(value))
            for capture, some in (each or {}).items()
            for name, value in some.items()
            if isinstance(value, Message)
        }
        told: dict[str, Any] = {
            "code": self.name,
            "severity": self.severity,
            "captures": list(captures),
            "values": _told(filled),
            "text": self.said(filled, captures, ENGLISH),
            "to_do": self.told_to_do(filled, captures, ENGLISH),
            "remedy": remedy and self._titled(remedy, filled, captures),
        }
        more: dict[str, Any] = {"where": where, "behind": behind, "each": by_capture, "messages": parts}
        return Finding(**told, **{name: value for name, value in more.items() if value})

    def said(self, values: Mapping[str, Value], captures: Sequence[str], language: Catalogue) -> str:
        """Return what it says in a language; raises KeyError where a value is missing."""
        return self.filled(self.text, values, captures, language)

    def told_to_do(self, values: Mapping[str, Value], captures: Sequence[str], language: Catalogue) -> str:
        """Return what to do in a language; raises KeyError where a value is missing."""
        return self.filled(self.to_do, values, captures, language)

    def _titled(self, remedy: RootCause, values: Mapping[str, Value], captures: Sequence[str]) -> RootCause:
        texts = [self.said(values, captures, ENGLISH), self.told_to_do(values, captures, ENGLISH)]
        title = self.filled(self.title, values, captures, ENGLISH)
        return (
            remedy.model_copy(update={"title": title, "sentence": ENGLISH.sentences(texts)}) if title else remedy
        )

    def filled(
        self, choice: Choice, values: Mapping[str, Value], captures: Sequence[str], language: Catalogue
    ) -> str:
        """Return one of its texts in a language; raises KeyError where a value is missing."""
        text, places = self._chosen(choice, values), {"captures": Names(captures), **values}
        if isinstance(text, Plural):
            return language.fill(text.one, places, text.many, text.by)
        return language.fill(text, places) if text else ""

    def as_message(self, choice: Choice, values: Mapping[str, Value], captures: Sequence[str]) -> Message:
        """Return one of its texts as a message, which can be said elsewhere; raises KeyError as `filled` does."""
        text, places = self._chosen(choice, values), {"captures": Names(captures), **values}
        return Message(text.one, places, text.many, text.by) if isinstance(text, Plural) else Message(text, places)

    def _chosen(self, choice: Choice, values: Mapping[str, Value]) -> Text:
        by = self.by_to_do if choice is self.to_do and self.by_to_do else self.by
        return choice[str(values[by])] if isinstance(choice, Mapping) else choice

    def texts(self) -> list[Text]:
        """Return all texts that are translated."""
        found: list[Text] = []
        for choice in (self.text, self.to_do, self.reason, self.title):
            found += choice.values() if isinstance(choice, Mapping) else [choice]
        return [text for text in found if text]

    def page(self) -> tuple[str, str, str]:
        """Return the texts of its page: what it means, how it is decided, what usually causes it."""
        return self.meaning, self.decided, self.usual_causes

    def places(self) -> list[str]:
        """Return the names of all its values, in the order in which its texts name them."""
        texts = [
            part
            for text in self.texts()
            for part in ((text.one, text.many) if isinstance(text, Plural) else (text,))
        ]
        named = [name for text in texts for name in places_of(text)] + [
            by for by in (self.by, self.by_to_do) if by
        ]
        return [name for name in dict.fromkeys(named) if name != "captures"]


_FORMATTER: Final = Formatter()


def places_of(text: str) -> list[str]:
    """Return the names of a text's places, and of those that say how a number is written."""
    return [
        place for _, name, spec, _ in _FORMATTER.parse(text) if name for place in (name, *places_of(spec or ""))
    ]


def _told(values: Mapping[str, Value]) -> dict[str, Told]:
    return {
        name: value
        if isinstance(value, int | float)
        else str(value)
        if isinstance(value, str)
        else ", ".join(cast(Sequence[str], value))
        for name, value in values.items()
    }
