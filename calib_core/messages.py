"""Texts that can be said in several languages: a message with named places, and the values that fill them.

A `Message` is a `str`, its English text, so that it goes wherever a text goes; it also knows what it was made of,
so that whoever prints or sends it can say it in another language (`Catalogue.say`)::

    InputError(
        need=message("a pose of {count} numbers ({names})", count=6, names="x y z W P R"),
        got=plural("{count} number", "{count} numbers", by="count", count=5),
        to_do=message("Write it as the controller shows it."),
    )

A place takes Python's format (`{shift_mm:.2f}`) and its unit stands in the text.  A number without a format is
shown with three digits, a list as "a, b and c" (`{names:or}`: "a, b or c"; `{names:,}`: "a, b, c"), captures with
their runs ("p03–p07"), a message within a message in the same language.  Write whole sentences: no fragment that
is glued to another.
"""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from string import Formatter
from typing import Any, Final, TypeAlias

Value: TypeAlias = "str | float | Sequence[str]"
"""What fills a place: a number, a text or a message, or several texts."""

_SHORTEST_RUN: Final = 3
_MOST_NAMED: Final = 12
_NUMBERED: Final = re.compile(r"^(.*?)(\d+)$")
_SIGNIFICANT: Final = 3


class Message(str):
    """An English text that knows its template and values; made by `message` and `plural`."""

    template: str
    values: Mapping[str, Value]
    many: str
    by: str

    def __new__(cls, template: str, values: Mapping[str, Value], many: str = "", by: str = "") -> "Message":
        """Return the text as English says it."""
        self = super().__new__(cls, ENGLISH.fill(template, values, many, by))
        self.template, self.values, self.many, self.by = template, values, many, by
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return Message, (self.template, self.values, self.many, self.by)


def message(template: str, /, **values: Value) -> Message:
    """Return a text with named places, filled; the template is what translators see."""
    return Message(template, values)


def plural(one: str, many: str, /, *, by: str, **values: Value) -> Message:
    """Return a text that differs with a count: the value `by`, or how many it lists."""
    return Message(one, values, many, by)


class Names(tuple[str, ...]):
    """Names of captures: three or more that count on are said as a run, ``p03–p07``; a dozen are named at most."""

    __slots__ = ()


@dataclass(frozen=True)
class Catalogue:
    """A language: its translations by template, its plural, and how it joins things and sentences.

    Parameters
    ----------
    language : str
    texts : mapping
        From a template to its translation, in as many forms as the language has plurals.
    form_of : callable
        Which form stands with a count.
    and_, or_, comma, more, space : str
        What stands between things, and between sentences; `more` ends a list that is too long.
    """

    language: str
    and_: str
    or_: str
    comma: str
    more: str
    space: str
    form_of: Callable[[int], int]
    texts: Mapping[str, Sequence[str]] = field(default_factory=dict[str, Sequence[str]])

    def say(self, text: str) -> str:
        """Return a message, or a text that has no places, in this language; as it is where it is not known."""
        if isinstance(text, Message):
            return self.fill(text.template, text.values, text.many, text.by)
        return self.texts[text][0] if text in self.texts else text

    def fill(self, template: str, values: Mapping[str, Value], many: str = "", by: str = "") -> str:
        """Return a template in this language with its places filled; raises KeyError where a value is missing."""
        form = self.form_of(_count(values[by])) if many else 0
        forms = self.texts.get(template) or ((template, many) if many else (template,))
        if not self.texts.get(template) and many:
            form = ENGLISH.form_of(_count(values[by]))
        return _Filler(self).vformat(forms[min(form, len(forms) - 1)], (), values)

    def sentences(self, parts: Iterable[str]) -> str:
        """Return sentences one behind the other, without those that are empty."""
        return self.space.join(part for part in parts if part)

    def listed(self, parts: Sequence[str], last: str = "") -> str:
        """Return things as a sentence lists them: a, b and c."""
        said = [self.say(part) for part in parts]
        return (last or self.and_).join([self.comma.join(said[:-1]), said[-1]] if len(said) > 1 else said)

    def captures(self, names: Sequence[str]) -> str:
        """Return captures as a sentence names them: ``p03, p07 and p09``, or ``f13–f24`` for a run."""
        parts = [
            part
            for run in _runs(names)
            for part in ([f"{run[0]}–{run[-1]}"] if len(run) >= _SHORTEST_RUN else run)
        ]
        if len(parts) > _MOST_NAMED:
            return self.more.format(self.comma.join(parts[:_MOST_NAMED]), len(parts) - _MOST_NAMED)
        return self.listed(parts)


class _Filler(Formatter):
    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue = catalogue

    def format_field(self, value: Any, format_spec: str) -> str:
        said = self._catalogue
        if isinstance(value, str):
            return said.say(value) if isinstance(value, Message) else value
        if isinstance(value, Names):
            return said.captures(value)
        if isinstance(value, list | tuple):
            return said.listed(value, {"or": said.or_, ",": said.comma}.get(format_spec, ""))  # pyright: ignore[reportUnknownArgumentType]
        if isinstance(value, float) and not math.isfinite(value):
            return "–"
        return format(value, format_spec) if format_spec or isinstance(value, int) else _three_digits(value)


def _three_digits(value: float) -> str:
    decimals = 0 if value == 0 else _SIGNIFICANT - 1 - math.floor(math.log10(abs(value)))
    return f"{value:.{min(max(decimals, 0), 6)}f}"


def _count(value: Value) -> int:
    return int(value) if isinstance(value, int | float) else len(value)


def _runs(names: Sequence[str]) -> list[list[str]]:
    runs: list[list[str]] = []
    for name in names:
        if runs and _follows(runs[-1][-1], name):
            runs[-1].append(name)
        else:
            runs.append([name])
    return runs


def _follows(name: str, after: str) -> bool:
    """Return whether a name counts on from another: p09 and p10."""
    first, second = _NUMBERED.match(name), _NUMBERED.match(after)
    return bool(first and second and first[1] == second[1] and int(second[2]) == int(first[2]) + 1)


ENGLISH: Final = Catalogue(
    "en", " and ", " or ", ", ", "{} and {} more", " ", lambda count: 0 if count == 1 else 1
)
"""The language that templates are written in."""
