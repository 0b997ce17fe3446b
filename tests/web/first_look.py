"""What one sees of a result without scrolling, measured from the page at 1280 × 720."""

from dataclasses import dataclass

from playwright.sync_api import Page, expect

MOST_WORDS = 60
MOST_MESSAGES = 3

_MEASURE = """() => {
  const card = document.querySelector(".answer-card"), box = card.getBoundingClientRect();
  const actions = [...document.querySelectorAll("sc-actions button")].filter((one) => one.checkVisibility());
  const main = actions.filter((one) => one.classList.contains("primary"));
  const messages = [...card.querySelectorAll(".messages li")];
  const inner = (element) => element.innerText.split(/\\s+/).filter(Boolean).length;
  const last = main[0]?.getBoundingClientRect();
  const height = (one) => one.getBoundingClientRect().height / parseFloat(getComputedStyle(one).lineHeight);
  // The cause of a failed answer is its heading.
  const isCause = (one) => one.matches(".answer-fail .messages > li:first-child");
  const cut = (one) => [...one.querySelectorAll("summary")].some((part) => part.scrollWidth > part.clientWidth);
  return {
    words: inner(card) + main.reduce((sum, one) => sum + inner(one), 0), messages: messages.length,
    lines: Math.max(0, ...messages.filter((one) => !isCause(one)).map(height)),
    causeLines: Math.max(0, ...messages.filter(isCause).map(height)),
    cut: messages.filter(cut).length,
    main: main.map((one) => one.innerText.trim().split("\\n")[0]),
    answer_in_sight: box.top >= 0 && box.bottom <= innerHeight,
    action_in_sight: !!last && last.top >= box.bottom && last.bottom <= innerHeight,
    tick_too_many: !!document.querySelector("[aria-current] .mark-pass") && !card.querySelector(".mark-pass"),
    text: card.innerText,
  };
}"""


@dataclass(frozen=True)
class FirstLook:
    """The words in sight of answer, verdict, messages and main action; and what is not as it should be."""

    words: int
    main: list[str]
    problems: list[str]


def first_look(page: Page, all_done: bool = False) -> FirstLook:
    """Measure the result that a page shows, at 1280 × 720; with `all_done` no next action is asked for."""
    page.set_viewport_size({"width": 1280, "height": 720})
    page.locator(".work").evaluate("(work) => { work.scrollTop = 0; }")
    expect(page.locator(".answer-card")).to_be_visible(timeout=120_000)
    if not all_done:
        expect(page.locator("sc-actions button.primary:visible").first).to_be_visible(timeout=120_000)
    seen = page.evaluate(_MEASURE)
    found = {
        f"{seen['words']} words: {seen['text']}": seen["words"] > MOST_WORDS,
        f"{seen['messages']} messages": seen["messages"] > MOST_MESSAGES,
        f"a message of {seen['lines']:.1f} lines": seen["lines"] > 1.3,
        f"a cause of {seen['causeLines']:.1f} lines": seen["causeLines"] > 2.3,
        f"{seen['cut']} messages do not fit their line": seen["cut"] > 0,
        f"{len(seen['main'])} main actions: {seen['main']}": len(seen["main"]) != 1 and not all_done,
        "the rail ticks what the answer does not accept": seen["tick_too_many"],
        "the answer is not in sight": not seen["answer_in_sight"],
        "the main action is not in sight": not seen["action_in_sight"] and not all_done,
    }
    return FirstLook(seen["words"], seen["main"], [words for words, wrong in found.items() if wrong])
