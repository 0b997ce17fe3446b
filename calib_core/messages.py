"""Texts that can be said in several languages: a message with named places, and the values that fill them.

A `Message` is a `str`, its English text, so that it goes wherever a text goes; it also knows what it was made of,
so that whoever prints or sends it can say it in another language (`Catalogue.say`)::

    InputError(
        "a pose of {count} numbers ({names})",
        plural("{given} number", "{given} numbers", by="given", given=5),
        "Write it as the controller shows it.",
        count=6,
        names="x y z W P R",
    )

A place takes Python's format (`{shift_mm:.2f}`) and its unit stands in the text.  A number without a format is
shown with three digits, a list as "a, b and c" (`{names:or}`: "a, b or c"; `{names:,}`: "a, b, c"), captures with
their runs ("p03–p07"), a message within a message in the same language.  Write whole sentences: no fragment that
is glued to another.
"""

import math
import re
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from numbers import Integral, Real
from string import Formatter
from typing import Any, Final, TypeAlias, TypeVar, cast

T = TypeVar("T")
Value: TypeAlias = object
"""What fills a place: a number, a text or a message, or several texts; of anything else, how Python writes it."""

_SHORTEST_RUN: Final = 3
_MOST_NAMED: Final = 12
_NUMBERED: Final = re.compile(r"^(.*?)(\d+)$")
_SIGNIFICANT: Final = 3
_BETWEEN_NAMES: Final = re.compile("(?<=[!-~])([和或])(?=[!-~])")
"""Chinese writes no blanks but between its characters and Latin names."""


class Message(str):
    """An English text that knows its template and values; made by `message` and `plural`."""

    template: str
    values: Mapping[str, Value]
    many: str
    by: str

    def __new__(cls, template: str, values: Mapping[str, Value], many: str = "", by: str = "") -> "Message":
        """Return the text as English says it."""
        values = {name: _plain(value) for name, value in values.items()}
        self = super().__new__(cls, ENGLISH.fill(template, values, many, by))
        self.template, self.values, self.many, self.by = template, values, many, by
        if values and str(self):  # an empty text is anybody's
            _remember(self)
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return Message, (self.template, self.values, self.many, self.by)


_MADE: Final[OrderedDict[str, Message]] = OrderedDict()
_MOST_MADE: Final = 20_000


def _remember(made: Message) -> None:
    """Know a message by its English text: a record keeps the text alone."""
    _MADE[str(made)] = made
    with suppress(KeyError):  # another thread forgot it
        _MADE.move_to_end(str(made))
    while len(_MADE) > _MOST_MADE:
        with suppress(KeyError):  # another thread was faster
            _MADE.popitem(last=False)


def made_lately(text: str) -> Message | None:
    """Return the message whose English text this is, None where this process has made none of late."""
    return text if isinstance(text, Message) else _MADE.get(text)


def message(template: str, /, **values: Value) -> Message:
    """Return a text with named places, filled; the template is what translators see."""
    return Message(template, values)


def plural(one: str, many: str, /, *, by: str, **values: Value) -> Message:
    """Return a text that differs with a count: the value `by`, or how many it lists."""
    return Message(one, values, many, by)


class Sentences(tuple[str, ...]):
    """Sentences one behind the other."""

    __slots__ = ()


def sentences(parts: Iterable[str]) -> Message:
    """Return sentences, one behind the other, as one text; those that are empty are left out."""
    return Message("{all}", {"all": Sentences(part for part in parts if part)})


def templates(told: T, /) -> T:
    """Return a table as it is; the texts in it are templates, or texts without places, that are translated."""
    return told


def filled(text: str, values: Mapping[str, Value]) -> str:
    """Return a template with its places filled, or a text as it is that has none of them."""
    if not values or isinstance(text, Message) or "{" not in text:
        return text
    try:
        return Message(text, values)
    except (KeyError, ValueError, IndexError, AttributeError):  # what somebody wrote, with braces of its own
        return text


def explained(what: str, why: object) -> Message:
    """Return what something is said of, a colon, and what is said."""
    said = str(why)  # an error's text alone: which message it was made of is remembered
    return message("{what}: {why}", what=what, why=made_lately(said) or Message(said, {}))


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
        return self.texts[text][0] if text in self.texts and not isinstance(text, _Own) else text

    def fill(self, template: str, values: Mapping[str, Value], many: str = "", by: str = "") -> str:
        """Return a template in this language with its places filled; raises KeyError where a value is missing."""
        form = self.form_of(_count(values[by])) if many else 0
        forms = self.texts.get(template) or ((template, many) if many else (template,))
        if not self.texts.get(template) and many:
            form = ENGLISH.form_of(_count(values[by]))
        if not values:  # a text without places, in which braces are braces
            return forms[0]
        return _Filler(self).vformat(forms[min(form, len(forms) - 1)], (), values)

    def sentences(self, parts: Iterable[str]) -> str:
        """Return sentences one behind the other, without those that are empty."""
        return self.space.join(part for part in parts if part)

    def listed(self, parts: Sequence[str], last: str = "") -> str:
        """Return things as a sentence lists them: a, b and c."""
        said = [self.say(part) for part in parts]
        listed = (last or self.and_).join([self.comma.join(said[:-1]), said[-1]] if len(said) > 1 else said)
        return _BETWEEN_NAMES.sub(r" \1 ", listed) if self.language == "zh" else listed

    def captures(self, names: Sequence[str]) -> str:
        """Return captures as a sentence names them: ``p03, p07 and p09``, or ``f13–f24`` for a run."""
        parts = [
            part
            for run in _runs(names)
            for part in ([f"{run[0]}–{run[-1]}"] if len(run) >= _SHORTEST_RUN else run)
        ]
        if len(parts) > _MOST_NAMED:
            return self.more.format(self.comma.join(parts[:_MOST_NAMED]), len(parts) - _MOST_NAMED)
        return self.listed([_Own(part) for part in parts])


def data_of(said: Message) -> dict[str, Any]:
    """Return a message as JSON data, of which `message_of` makes it again."""
    values = {name: _value_data(value) for name, value in said.values.items()}
    more = {name: text for name, text in (("many", said.many), ("by", said.by)) if text}
    return {"template": said.template, "values": values, **more}


def message_of(data: Mapping[str, Any]) -> Message:
    """Return a message from JSON data."""
    values = {name: _value_of(value) for name, value in data.get("values", {}).items()}
    return Message(data["template"], values, data.get("many", ""), data.get("by", ""))


SAID: Final = "said"
"""The field of a document for its messages' parts; what is stored, or comes from another process, has it."""


_FINDING: Final = {"code", "severity", "text"}
_JUDGED: Final = {"findings", "verdict", "warnings"}
_OF_FINDINGS: Final = _JUDGED | {"notes", "causes"}


def with_parts(document: dict[str, Any]) -> dict[str, Any]:
    """Return a document with the parts of the messages in it, so that they can be said where it is read.

    Findings need none, nor what is made of them: their codes and values say them. Left in, they would be there
    only in a process that has said them before, and the same result would be two documents.
    """
    made = {text: found for text in _texts_in(document) if (found := made_lately(text)) is not None}
    return {**document, SAID: [data_of(one) for one in made.values()]} if made else document


def remember_parts(document: Any) -> None:
    """Know a document's messages, so that what is made of their texts can be said as well."""
    for _ in parts_in(document):
        pass


def parts_in(document: Any) -> Iterator[Message]:
    """Give the messages whose parts a document, or one within it, holds."""
    if isinstance(document, dict):
        for name, value in cast("dict[str, Any]", document).items():
            if name == SAID and isinstance(value, list):
                yield from (message_of(parts) for parts in cast("list[Any]", value))
            else:
                yield from parts_in(value)
    elif isinstance(document, list) and not are_numbers(cast("list[Any]", document)):
        for one in cast("list[Any]", document):
            yield from parts_in(one)


def are_numbers(items: Sequence[object]) -> bool:
    """Return whether a list holds numbers, of which there may be many, and no texts."""
    return not items or isinstance(items[0], int | float)


def _texts_in(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        fields = cast("dict[str, Any]", value)
        left_out = _OF_FINDINGS if fields.keys() >= _JUDGED else ()
        for name, one in () if fields.keys() >= _FINDING else fields.items():
            yield from () if name in left_out else _texts_in(one)
    elif isinstance(value, list) and not are_numbers(cast("list[Any]", value)):
        for one in cast("list[Any]", value):
            yield from _texts_in(one)


_LISTS: Final = {"names": Names, "sentences": Sentences, "list": list}


def _value_data(value: Any) -> Any:
    if isinstance(value, Message):
        return data_of(value)
    if isinstance(value, list | tuple):
        kind = next(name for name, made in _LISTS.items() if isinstance(value, made) or name == "list")
        return {kind: [_value_data(one) for one in value]}  # pyright: ignore[reportUnknownVariableType]
    return value


def _value_of(data: Any) -> Any:
    if not isinstance(data, dict):
        return data
    if "template" in data:
        return message_of(data)  # pyright: ignore[reportUnknownArgumentType]
    return next(_LISTS[kind](_value_of(one) for one in parts) for kind, parts in data.items())  # pyright: ignore


class _Own(str):
    """What somebody named, or wrote: said as it stands in every language."""

    __slots__ = ()


_OWN: Final = frozenset("axes axis capture carrier mount scanner sphere who".split())  # noqa: SIM905
"""The places that hold what somebody named; a message in one is said as others are."""


class _Filler(Formatter):
    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue = catalogue

    def get_value(self, key: int | str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
        value = super().get_value(key, args, kwargs)
        if key not in _OWN or isinstance(value, Message | Names):
            return value
        if isinstance(value, list | tuple):
            return [one if isinstance(one, Message) else _Own(one) for one in cast("Sequence[str]", value)]
        return _Own(value) if isinstance(value, str) else value

    def format_field(self, value: Any, format_spec: str) -> str:
        said = self._catalogue
        if isinstance(value, str):
            return said.say(value)
        if isinstance(value, Names):
            return said.captures(value)
        if isinstance(value, Sentences):
            return said.sentences(said.say(part) for part in value)
        if isinstance(value, list | tuple):
            return said.listed(value, {"or": said.or_, ",": said.comma}.get(format_spec, ""))  # pyright: ignore[reportUnknownArgumentType]
        if isinstance(value, float) and not math.isfinite(value):
            return "–"
        number = format(value, format_spec) if format_spec or isinstance(value, int) else _three_digits(value)
        return number.replace("%", "\u00a0%") if said.language == "de" else number


def _plain(value: Any) -> Value:
    """Return a value as a catalogue formats it, and a file keeps it."""
    if isinstance(value, str):
        return made_lately(value) or value
    if isinstance(value, int | Names | Sentences) or (isinstance(value, list | tuple) and _are_texts(value)):
        return value  # pyright: ignore[reportUnknownVariableType]
    if isinstance(value, Real):
        return int(value) if isinstance(value, Integral) else float(value)
    return str(value)


def _are_texts(values: Iterable[object]) -> bool:
    return all(isinstance(value, str) for value in values)


def _three_digits(value: float) -> str:
    decimals = 0 if value == 0 else _SIGNIFICANT - 1 - math.floor(math.log10(abs(value)))
    return f"{value:.{min(max(decimals, 0), 6)}f}"


def _count(value: Value) -> int:
    return int(value) if isinstance(value, int | float) else len(cast("Sequence[str]", value))


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
