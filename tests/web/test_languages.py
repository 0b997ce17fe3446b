"""No text is cut off in any language: what is in sight is measured against what holds and clips it."""

import re
from typing import Any, cast

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.server.live_server import simulated_session, wait_for
from tests.web.browsing import SharedProfile, Watch, in_language

pytestmark = pytest.mark.browser

# Tables that scroll sideways by themselves, drawings, and a name of the user's own, are not texts that are cut.
_CUT = """() => {
  const apart = "svg, iframe, pre, textarea, .visually-hidden, .skip, sc-toasts, .table-holder, .columns"
    + ", .session-title";
  const cut = [];
  for (const one of document.querySelectorAll("body *")) {
    if (!one.checkVisibility({ visibilityProperty: true }) || one.closest(apart)) continue;
    const isText = (node) => node.nodeType === Node.TEXT_NODE && node.textContent.trim();
    const texts = [...one.childNodes].filter(isText);
    if (one.matches("select, option") || !texts.length) continue;
    const range = document.createRange();
    range.selectNodeContents(texts[0]);
    range.setEndAfter(texts.at(-1));
    const box = range.getBoundingClientRect();
    if (!box.width) continue;
    for (let holder = one; holder && holder !== document.body; holder = holder.parentElement) {
      const style = getComputedStyle(holder), held = holder.getBoundingClientRect();
      const wide = box.right > held.right + 1 || box.left < held.left - 1;
      const high = box.bottom > held.bottom + 2;
      const clips = (wide && style.overflowX !== "visible") || (high && style.overflowY === "hidden");
      if (clips || (holder.matches("button, .button") && (wide || high))) {
        cut.push(`${one.tagName.toLowerCase()}.${one.className}: ${one.textContent.trim().slice(0, 60)}`);
        break;
      }
    }
  }
  if (document.documentElement.scrollWidth > innerWidth + 1) cut.push("the page scrolls sideways");
  return cut;
}"""


# What was typed, what is copied as it is, and numbers of a controller keep their point.
_POINTS = """() => {
  const typed = ".frame-numbers, .suggestion, .captures .pose .number";
  const apart = `pre, textarea, option, script, style, .mono, .session-title, ${typed}`;
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), found = [];
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    if (node.parentElement.closest(apart) || !node.parentElement.checkVisibility()) continue;
    if (/(?<![\\w.])\\d+\\.\\d+(?![\\w.])/.test(node.data)) found.push(`a decimal point: ${node.data}`);
    if (/\\d ±|± \\d|[^\\d\\u00a0] ?±\\s\\d/.test(node.data)) found.push(`± may break: ${node.data}`);
  }
  return found;
}"""


# Sentences of the server that were not known when they were first said are said again once they are.
_TRANSLATED = """() => {
  // Exports are offered by the names of their controllers' own files.
  const parts = document.querySelectorAll(".work > .view:not([hidden]) :not(select, select *), sc-rail");
  const own = [...parts].flatMap((one) => [...one.childNodes]).filter((node) => node.nodeType === Node.TEXT_NODE);
  return !/\\b(the|of|is|are|with|and)\\b/.test(own.map((node) => node.data).join(" "));
}"""


@pytest.fixture(scope="module")
def session(address: str) -> str:
    """A result of which a capture was left out."""
    with httpx.Client(base_url=f"{address}/api/v1", timeout=300, trust_env=False) as client:
        session = simulated_session(client, captures=14, scenario="tcp-moved-sphere")
        assert wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"])["status"] == "done"
    return session


@pytest.fixture(params=["en-GB", "de-DE", "zh-CN"])
def page(request: pytest.FixtureRequest, profile: SharedProfile) -> Page:
    page = profile.open(reduced_motion="reduce")
    in_language(page, request.param)
    page.goto("/")
    expect(page.locator("html")).to_have_attribute("lang", re.compile(f"^{request.param[:2]}"))
    return page


@pytest.mark.thorough(keep=1)
def test_no_text_is_cut_off(page: Page, session: str, watch: Watch) -> None:
    found: dict[str, list[str]] = {}

    def look(where: str) -> None:
        for width, height in ((1280, 720), (1024, 768)):
            page.set_viewport_size({"width": width, "height": height})
            if cut := page.evaluate(_CUT):
                found[f"{where}, {width} px"] = cut
        language = page.locator("html").get_attribute("lang")
        points = page.evaluate(_POINTS)
        found[f"{where}, numbers"] = [one for one in points if language == "de" or one.startswith("±")]
        if language != "en" and where in ("result", "measure", "bad file"):
            page.wait_for_function(_TRANSLATED)

    expect(page.locator(".session-card").first).to_be_visible()
    look("first page")
    page.goto(f"/sessions/{session}#tcp.result")
    page.locator(".answer-card").wait_for()
    page.evaluate("() => document.querySelectorAll('sc-result details').forEach((one) => { one.open = true; })")
    look("result")
    chosen = page.locator("sc-scene select option")
    if page.locator("html").get_attribute("lang") == "zh-Hans":  # views were offered by their English names
        expect(chosen.nth(1)).to_be_attached()
        expect(chosen.filter(has_text=re.compile("[a-z]"))).to_have_count(0)
    page.locator("#tab-measure").click()
    expect(page.locator("table.captures tbody tr")).to_have_count(14)
    page.locator("table.captures .pick").nth(2).click()
    look("measure")
    page.set_viewport_size({"width": 1280, "height": 720})
    row = page.locator("sc-actions > .row").bounding_box()
    assert row is not None
    assert row["height"] < 60  # in one row
    scrolled = "(table) => table.parentElement.scrollWidth - table.parentElement.clientWidth"
    assert page.locator("table.captures").evaluate(scrolled) <= 0  # no column is cut
    watch.announce("status of 422.*/readings")
    broken = {
        "name": "p99.csv",
        "mimeType": "text/csv",
        "buffer": b"x_mm,z_mm\n1,2\n2,3\n3",
    }  # cut in its last line
    page.locator("sc-intake input[type=file]").first.set_input_files(cast(Any, broken))
    page.locator("sc-file-list tbody tr").wait_for()
    page.locator("sc-file-list select").select_option("profiles")  # it was taken for nothing
    page.locator("sc-file-reading section").wait_for()
    look("bad file")
    page.keyboard.press("Escape")
    page.locator("h1").first.click()
    page.keyboard.press("?")
    page.locator("dialog[open]").wait_for()
    look("keys")
    page.keyboard.press("Escape")
    page.goto(f"/sessions/{session}/review")
    page.locator("sc-review-captures tbody tr").first.wait_for()
    look("review")
    page.goto(f"/compare?stage=tcp&left={session}&right={session}")
    page.locator(".comparison section").first.wait_for()
    look("comparison")
    assert {where: what for where, what in found.items() if what} == {}


def test_words_of_the_scene_that_come_while_others_are_asked_for_are_asked_for_too(profile: SharedProfile) -> None:
    page = profile.open(reduced_motion="reduce")
    in_language(page, "de-DE")
    page.goto("/")
    expect(page.locator("html")).to_have_attribute("lang", "de")
    words = page.evaluate("""async () => {
        const folder = document.querySelector("script[type=module]").src.replace(/app[.]js$/, "");
        const { sayer } = await import(`${folder}measure/scene-words.js`);
        let asked = 0, told;
        const all = new Promise((done) => { told = done; });
        const fetched = window.fetch;
        window.fetch = (...given) => { if (!asked++) say("Turntable"); return fetched(...given); };
        const say = sayer(() => { if (say("Turntable") !== "Turntable") told(); });
        say("next pose");
        await all;
        return [say("next pose"), say("Turntable")];
    }""")
    assert words == ["nächste Pose", "Drehtisch"]
