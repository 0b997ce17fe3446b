"""Words of the documents that are written by hand, as `wc -w` counts them."""

from pathlib import Path

from harness import Row

ROOT = Path(__file__).resolve().parents[2]
MOST_WORDS, MOST_WORDS_OF_A_PAGE = 30_000, 1_200


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` changes nothing."""
    pages = sorted(
        {*(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "robots").glob("*.md")} - {ROOT / "docs" / "figures.md"}
    )
    words = {page.name: len(page.read_text("utf-8").split()) for page in pages}
    changes = len((ROOT / "CHANGELOG.md").read_text("utf-8").split())
    total = sum(words.values()) + changes
    longest = max(words, key=lambda name: words[name])
    return [
        Row(
            "words in docs and CHANGELOG, without generated pages",
            f"≤ {MOST_WORDS:,}",
            f"{total:,}",
            total <= MOST_WORDS,
        ),
        Row(
            "words of the longest page of docs/",
            f"≤ {MOST_WORDS_OF_A_PAGE:,}",
            f"{words[longest]:,} ({longest})",
            words[longest] <= MOST_WORDS_OF_A_PAGE,
        ),
    ]
