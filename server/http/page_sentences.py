"""What the server says, in the languages of the page: of two thousand sentences a page gets those that it shows.

A page that loaded them all would load more words than code. Which of them stand in a text, alone, within another
or one behind the other, is the page's to find out (`web/sentences.js`); a little more than it needs is sent.
"""

import json
import re
from functools import lru_cache
from pathlib import Path

_ENTRY = re.compile(r'^  ("(?:[^"\\]|\\.)*"): (\{.*\}),$', re.MULTILINE)
_MOST_LETTERS = 16_000


class PageSentences:
    """The sentences in the files of a page.

    Parameters
    ----------
    folder : Path
        The page's files: those in `texts/server` hold a template a line with its translations, as JSON, with {}
        for what changes.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "texts" / "server"

    def occurring(self, language: str, texts: list[str]) -> dict[str, str]:
        """Return from template to translation what may occur in texts: all words of it do.

        A page asks for half as many letters at a time as are looked at.
        """
        asked = _plain("\n".join(texts)[:_MOST_LETTERS])
        state = tuple((file, file.stat().st_mtime_ns) for file in sorted(self._folder.glob("*.js")))
        return {
            template: words[language]
            for template, words, parts in _templates(state)
            if all(part in asked for part in parts)
        }


def entries_of(file: Path) -> list[tuple[str, dict[str, str]]]:
    """Return a file's templates, each with its translations by language."""
    return [
        (json.loads(said), json.loads(words)) for said, words in _ENTRY.findall(file.read_text(encoding="utf-8"))
    ]


@lru_cache(maxsize=2)
def _templates(state: tuple[tuple[Path, int], ...]) -> list[tuple[str, dict[str, str], list[str]]]:
    """Return templates, translations, and what must occur of a template, the longest first."""
    return [
        (said, words, sorted(parts_of(said), key=len, reverse=True))
        for file, _ in state
        for said, words in entries_of(file)
    ]


def parts_of(template: str) -> list[str]:
    """Return what stands around a template's places; within another sentence its stop is not there."""
    return [_plain(part).strip(" .") for part in template.split("{}")]


def _plain(text: str) -> str:
    """Return a text as it is compared: a sentence may begin small, and each number counts as 0."""
    return re.sub(r"\d+", "0", text).lower()
