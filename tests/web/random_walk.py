"""A random walk over the page: at every step one of the controls in sight is used, whatever it is.

After each action the page must still be itself: something to read, something to do, no complaint.
"""

import random
import re
from collections import Counter, deque
from dataclasses import dataclass, field
from typing import Any

from playwright.sync_api import ConsoleMessage, Error, Page
from playwright.sync_api import TimeoutError as PlaywrightTimeout

# Marks the controls that can be used now: seen, enabled, and not below something else.
_CONTROLS = """() => {
  const top = document.querySelector("dialog:modal") ?? document;
  const all = top.querySelectorAll(
    "a[href], button, input:not([type=file]):not([type=hidden]), select, textarea, summary, [role=tab], .dot");
  const seen = [];
  for (const one of all) {
    if (one.disabled || one.closest("[inert], [hidden]")) continue;
    if (!one.checkVisibility({ visibilityProperty: true })) continue;
    const box = one.getBoundingClientRect();
    if (box.width < 2 || box.height < 2 || one.classList.contains("visually-hidden")) continue;
    if (one.matches("a") && (one.target === "_blank" || new URL(one.href).origin !== location.origin)) continue;
    // The session that is walked in stays: what ends it for good is not pressed, in whatever language the walk is.
    if (one.matches("button.danger") && one.closest("dialog")?.querySelector("#deed-title")) continue;
    if (one.matches("a[download], a[href^='/docs'], a[href$='/report'], a[href*='/api/']")) continue;
    seen.push(one);
  }
  window.walkControls = seen;
  return seen.length;
}"""
_USE = """([index, chance]) => {
  const one = window.walkControls[index];
  if (!one?.isConnected) return null;
  const name = (one.getAttribute("aria-label") || one.innerText || one.name || one.id || "").trim().slice(0, 60);
  const what = `${one.tagName.toLowerCase()} ${name}`;
  one.scrollIntoView({ block: "center" });
  if (one.matches("select")) {
    if (one.options.length) one.selectedIndex = Math.floor(chance * one.options.length);
    one.dispatchEvent(new Event("input", { bubbles: true }));
    one.dispatchEvent(new Event("change", { bubbles: true }));
    return { what };
  }
  if (one.matches("textarea, input:not([type=checkbox]):not([type=radio]):not([type=range])")) {
    const words = ["12.5", "", "p01", "-1", "abc <b>", "1 2 3 4 5 6"];
    one.focus();
    one.value = one.type === "number" ? String(Math.round(chance * 90)) : words[Math.floor(chance * words.length)];
    one.dispatchEvent(new Event("input", { bubbles: true }));
    one.dispatchEvent(new Event("change", { bubbles: true }));
    return { what };
  }
  const box = one.getBoundingClientRect();
  const at = [box.left + box.width / 2, box.top + box.height / 2];
  const hit = document.elementFromPoint(...at);
  return { what, at: hit && (one.contains(hit) || hit.contains(one)) ? at : null };
}"""
_CLICK = """(index) => {
  window.walkControls[index].dispatchEvent(new MouseEvent("click", { bubbles: true, cancelable: true }));
}"""
_TOLD = "sc-toasts .toast, [role=alert]:not(.visually-hidden), dialog[open] .mark-fail, .lost h1"
# A toast may be closed by the very next action: that it was there is remembered.
_REMEMBER = f"""new MutationObserver(() => {{
  if (document.querySelector("{_TOLD}")) window.walkTold = performance.now();
}}).observe(document, {{ subtree: true, childList: true, attributes: true }})"""
_LATELY = "() => performance.now() - (window.walkTold ?? -1e9) < 5000"
_ALIVE = """() => {
  const text = document.body.innerText.trim();
  return { words: text.length, bad: /undefined|NaN|\\[object /.exec(text)?.[0] ?? null };
}"""
_KEYS = (
    "Escape",
    "Tab",
    "Enter",
    "ArrowRight",
    "ArrowLeft",
    "m",
    "r",
    "s",
    "1",
    "3",
    "x",
    "?",
    "Control+z",
    "Control+y",
)
_REFUSED = re.compile(r"Failed to load resource: the server responded with a status of 4\d\d")
_SHORT = re.compile("Failed to load resource: the server responded with a status of ")


@dataclass
class Walk:
    """What was done, and what was found."""

    actions: int = 0
    used: Counter[str] = field(default_factory=Counter[str])
    problems: list[str] = field(default_factory=list[str])


def walk(page: Page, home: str, actions: int, seed: int, stop_at: int = 5) -> Walk:
    """Do so many actions from `home`, an address; it goes back there where a dead end is found, and says so."""
    lot = random.Random(seed)
    done = Walk()
    recent: deque[str] = deque(maxlen=3)

    def complain(words: str) -> None:
        done.problems.append(
            f"action {done.actions}, after {list(recent)} at {page.url.split('/', 3)[-1]}: {words}"
        )

    refused: list[str] = []

    def heard(message: ConsoleMessage) -> None:
        if message.type == "error":
            # What the server refuses must be told to who asked; anything else is a defect.
            words = f"{message.text} {message.location['url'].split('/', 3)[-1]}"
            (refused.append if _REFUSED.search(words) else complain)(words)

    page.on("console", heard)
    page.on("pageerror", lambda error: complain(str(error)))
    page.on("dialog", lambda dialog: dialog.dismiss())
    page.on("popup", lambda other: other.close())
    page.add_init_script(_REMEMBER)
    page.goto(home)
    page.locator("h1").first.wait_for()
    while done.actions < actions and len(done.problems) < stop_at:
        done.actions += 1
        place = page.url.partition("?")[0]
        try:
            if did := _act(page, lot, done):
                recent.append(did)
            alive: dict[str, Any] = page.evaluate(_ALIVE)
        except Error as error:
            if "context was destroyed" in str(error) or "navigat" in str(error).lower():
                page.wait_for_load_state()
                continue
            raise
        left = page.url.partition("?")[0] != place  # an answer to a page that was left has nobody to tell it to
        if refused and not left and not _told(page):
            complain(f"refused without a word: {_SHORT.sub('', refused[0])}")
        refused.clear()
        if alive["bad"]:
            complain(f"the page says {alive['bad']}")
            page.goto(home)
        if page.url == "about:blank" or done.actions % 150 == 0:
            page.goto(home)
            page.locator("h1").first.wait_for()
            refused.clear()  # of what was still on its way; the page that would tell of it is gone
    return done


def _told(page: Page) -> bool:
    """Return whether the page says, or has just said, that something was refused."""
    if page.evaluate(_LATELY):
        return True
    try:
        page.locator(_TOLD).first.wait_for(timeout=2000)
    except PlaywrightTimeout:
        return False
    return True


def _act(page: Page, lot: random.Random, done: Walk) -> str | None:
    """Use one control, or press a key; return what it was."""
    if lot.random() < 0.08:
        key = lot.choice(_KEYS)
        page.keyboard.press(key)
        return f"key {key}"
    count = page.evaluate(_CONTROLS)
    for _ in range(20):  # a page that is only loading has nothing for a moment
        if count:
            break
        page.wait_for_timeout(100)
        count = page.evaluate(_CONTROLS)
    if not count:
        done.problems.append(f"action {done.actions}: a dead end at {page.url}: {page.inner_text('body')[:200]}")
        page.go_back()
        return None
    index = lot.randrange(count)
    used = page.evaluate(_USE, [index, lot.random()])
    if used is None:
        return None
    done.used[used["what"].split(" ")[0]] += 1
    if used.get("at"):
        page.mouse.click(*used["at"])
    elif "at" in used:
        page.evaluate(_CLICK, index)
    return used["what"]
