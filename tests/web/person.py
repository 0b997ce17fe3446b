"""A person who goes through the page by one hand alone, keyboard or mouse, and notes what stands in the way."""

import os
import re
from pathlib import Path
from typing import Literal

from playwright.sync_api import Locator, Page, expect

Means = Literal["keyboard", "mouse"]
PICTURES = os.environ.get("SCANCELL_PICTURES")  # a folder for a picture of every moment

_LISTEN = """{
  window.silent = [];
  const words = () => document.body?.innerText.replace(/[0-9]+/g, "") ?? "";
  const busy = () => [...document.querySelectorAll("[aria-busy=true], progress, .job, [role=status]")]
    .some((one) => one.checkVisibility() && (one.tagName === "PROGRESS" || one.innerText.trim()));
  const heed = (event) => {
    if (!event.isTrusted || (event.type === "keydown" && event.key !== "Enter" && event.key !== " ")) return;
    const button = event.target.closest?.("button, a, summary, [role=tab]");
    if (!button) return;
    const before = words(), name = button.innerText;
    setTimeout(() => { if (!busy() && words() === before) window.silent.push(name); }, 1000);
  };
  for (const kind of ["click", "keydown"]) window.addEventListener(kind, heed, true);
}"""
_WAY = """(one) => one === document.activeElement ? null
  : one.compareDocumentPosition(document.activeElement) & Node.DOCUMENT_POSITION_FOLLOWING ? 'Shift+Tab' : 'Tab'"""
_MOST_TABS = 120


class Person:
    """Does what the page says first, by one means alone.

    Parameters
    ----------
    page : Page
    means : {"keyboard", "mouse"}
    """

    def __init__(self, page: Page, means: Means) -> None:
        page.add_init_script(_LISTEN)  # of addresses that are opened from now on
        self.page, self.means = page, means
        self.done: list[str] = []
        self.refused: list[str] = []
        self._asked_for_files: list[str] = []

    def press(self, what: Locator, main: bool = False) -> str:
        """Press a control, which the keyboard must reach by Tab; Enter alone is the main one. Return its name."""
        expect(what).to_be_enabled()
        expect(what).not_to_have_attribute("aria-disabled", "true")
        name = what.inner_text().split("\n")[0].strip()
        if self.means == "mouse":
            what.click()
        else:
            if not main or not self.page.evaluate("document.activeElement === document.body"):
                self.reach(what)
            self.page.keyboard.press("Enter")
        self.done.append(name)
        return name

    def reach(self, what: Locator) -> None:
        """Go to a control by Tab."""
        for _ in range(_MOST_TABS):
            way = what.evaluate(_WAY)
            if not way:
                return
            self.page.keyboard.press(way)
        raise AssertionError(f"Tab does not reach {what}")

    def named(self, name: str) -> str:
        """Press the button of a name."""
        return self.press(self.page.get_by_role("button", name=re.compile(f"^{name}")).first)

    def fill(self, label: str, text: str) -> None:
        """Type into a field."""
        field = self.page.get_by_label(label)
        if self.means == "mouse":
            field.click()
        else:
            self.reach(field)
        self.page.keyboard.press("Control+a")
        self.page.keyboard.type(text)
        self.done.append(label)

    def choose_files(self, name: str, path: Path) -> None:
        """Press the button that asks for files or a folder, and choose."""
        with self.page.expect_file_chooser() as chooser:
            self._asked_for_files.append(self.named(name))  # the browser's own window is the word
        chooser.value.set_files(path)

    @property
    def primary(self) -> Locator:
        return self.page.locator("sc-actions button.primary:visible")

    def go_on(self) -> str:
        """Do the one thing that the page offers first, and wait until it asks for the next; return what it was."""
        expect(self.primary).to_have_count(1)
        before = self.page.evaluate(_STAND)
        self.look(f"{len(self.done):02d}")
        name = self.press(self.primary, main=True)
        self.page.wait_for_function(
            f"(before) => ({_STAND})() !== before && !({_BUSY})", arg=before, timeout=300_000
        )
        self.refused += self.page.locator(".toast.bad").all_inner_texts()
        return name

    def look(self, name: str) -> None:
        """Keep a picture of the moment where somebody wants them."""
        if PICTURES:
            Path(PICTURES).mkdir(parents=True, exist_ok=True)
            self.page.screenshot(path=Path(PICTURES) / f"{self.means}-{name}.png")

    def require_a_clear_way(self) -> None:
        """Fail where a primary action was refused, or a second passed without a word."""
        silent = [one for one in self.page.evaluate("window.silent") if one not in self._asked_for_files]
        assert not self.refused, f"refused: {self.refused} on the way {self.done}"
        assert not silent, f"no word within a second: {silent} on the way {self.done}"


_STAND = (
    "() => JSON.stringify([document.querySelector('sc-guide h1')?.innerText,"
    " document.querySelectorAll('table.captures tbody tr').length,"
    " document.querySelector('sc-rail [aria-current=step]')?.dataset.step,"
    " document.querySelector('[role=tab][aria-selected=true]')?.innerText,"
    " document.querySelectorAll('sc-rail .answer').length, document.querySelector('#answer-title')?.innerText])"
)
_BUSY = (  # at the end of the way nothing is next
    "document.querySelector('sc-actions .job')?.checkVisibility()"
    " || document.querySelector('sc-actions .primary[aria-disabled=true]')"
    " || !(document.querySelector('sc-rail .status-done[aria-current=step]')"
    " || [...document.querySelectorAll('sc-actions button.primary')].some((one) => one.checkVisibility()))"
)
