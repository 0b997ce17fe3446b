"""The table of what was found beside the truth, in the terminal's language."""

from dataclasses import dataclass, field

from calib_core.evidence.text import padded, verdict_words
from calib_core.messages import Catalogue, message

_LABEL, _FOUND, _TRUTH, _ERROR = 30, 24, 12, 10  # columns of the terminal


@dataclass(frozen=True)
class Sheet:
    """Lines of results beside the truth.

    Parameters
    ----------
    said : Catalogue
    lines : list of str
        What was added so far.
    """

    said: Catalogue
    lines: list[str] = field(default_factory=list[str])

    def title(self, stage: str, verdict: str, what: str) -> None:
        """Begin a stage's part with its verdict."""
        word, _ = verdict_words(verdict, self.said)
        about = f"  ({self.said.say(what)})" if what else ""
        self.lines.extend(["", f"{stage}: {word}{about}"])

    def heads(self, found: str) -> None:
        """Add the head of three columns."""
        self._row("", found, message("truth"), message("deviation"))

    def numbers(self, label: str, measured: str, found: float, true: float) -> None:
        """Add a number as it was measured, the true one, and how far they are apart."""
        self._row(label, measured, f"{true:.3f}", f"{found - true:.3f}")

    def line(self, label: str, text: str) -> None:
        """Add what is said of a result without a column of its own."""
        self._row(label, text, width=_FOUND + _TRUTH + _ERROR)

    def _row(self, label: str, *cells: str, width: int = _FOUND) -> None:
        right = [
            padded(self.said.say(cell), w, right=True)
            for cell, w in zip(cells, (width, _TRUTH, _ERROR), strict=False)
        ]
        self.lines.append("".join([f"  {padded(self.said.say(label), _LABEL)}", *right]))
