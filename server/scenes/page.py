"""viser's client page as we serve it: cut off from every other address, in our theme, with our legend on it.

The client is one HTML file. Left alone it would follow `?websocket=` to any server on the net and run what that
server sends, under our origin; so its query is cut to what we know before it starts, and a content security policy
lets it talk to this origin only.
"""

from base64 import b64encode
from functools import cache
from hashlib import sha256
from html.parser import HTMLParser
from pathlib import Path

_POLICY = "; ".join(
    [
        "default-src 'none'",
        # The client unpacks itself: a script that is known by its hash adds the rest, which evaluates strings.
        "script-src %s 'strict-dynamic' 'unsafe-eval'",
        "worker-src blob: data:",
        "connect-src 'self' blob: data:",
        "img-src 'self' blob: data:",
        "style-src 'unsafe-inline'",
        "font-src data:",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'self'",
    ]
)

_STYLE = """
<style>
html, body, #root { background: #fff; }
html.dark, html.dark body, html.dark #root { background: #141414; }
#scancell-legend {
  position: fixed; left: 0; right: 0; bottom: 0; z-index: 5; box-sizing: border-box; max-height: 30vh;
  overflow: auto; padding: 6px 12px; border-top: 1px solid rgb(0 0 0 / 0.1); columns: 2 200px; column-gap: 20px;
  font: 12px/1.5 system-ui, sans-serif; font-variant-numeric: tabular-nums; color: #24292f; background: #fff;
}
#scancell-legend > * { break-inside: avoid; }
.dark #scancell-legend { color: #e4e6ea; background: #1c1d20; border-color: rgb(255 255 255 / 0.12); }
#scancell-tip {
  position: fixed; z-index: 6; padding: 2px 6px; border-radius: 4px; pointer-events: none; max-width: 240px;
  font: 12px/1.4 system-ui, sans-serif; color: #fff; background: #24292f;
}
#scancell-tip:empty { display: none; }
#scancell-legend:empty { display: none; }
#scancell-legend h2 { margin: 0 0 4px; font-size: 12px; font-weight: 600; break-after: avoid; }
#scancell-legend p { margin: 0 0 2px; }
#scancell-legend .bar { height: 10px; border-radius: 2px; }
#scancell-legend .ticks { display: flex; justify-content: space-between; }
#scancell-legend .key { margin-right: 10px; display: inline-block; }
#scancell-legend .key i { font-style: normal; }
.mantine-Notifications-root { display: none; }
.embedded [data-floating-window] { display: none; }
</style>
"""

# The theme follows ?theme=dark|light, and the system's where nothing is said.  On narrow screens the client would
# lay its controls over half of the scene; told that no screen is narrow, it keeps them folded up in the corner.
_START = """
<script>
(() => {
  const asked = new URLSearchParams(location.search);
  const theme = asked.get("theme");
  const system = matchMedia("(prefers-color-scheme: dark)").matches;
  const dark = theme === "dark" || (theme !== "light" && system);
  const kept = new URLSearchParams();
  if (theme === "dark" || theme === "light") kept.set("theme", theme);
  if (dark) kept.set("darkMode", "");
  kept.set("hideViserLogo", "");
  // A page without an address of its own (srcdoc) has no query to cut either.
  if (location.protocol !== "about:") history.replaceState(null, "", location.pathname + "?" + kept);
  document.documentElement.classList.toggle("dark", dark);
  // A page around the scene has controls of its own.
  document.documentElement.classList.toggle("embedded", location.pathname.includes("/viewers/"));
  // The client connects again only where it has the focus, which the page around it has: being seen is enough.
  document.hasFocus = () => !document.hidden;
  document.addEventListener("visibilitychange", () => window.dispatchEvent(new Event("focus")));
  // It would try anew each second, and give up the try before.  Of a page of which some failed, as while a server
  // starts anew, Chromium holds back each by up to 5 s: none would ever come through.
  const post = Worker.prototype.postMessage;
  let tried = -Infinity;
  Worker.prototype.postMessage = function (message, ...more) {
    if (message?.type === "retry" && performance.now() < tried + 6000) return;
    if (["retry", "set_server"].includes(message?.type)) tried = performance.now();
    post.call(this, message, ...more);
  };
  const real = window.matchMedia.bind(window);
  window.matchMedia = (query) => real(query.startsWith("(max-width") ? "not all" : query);
})();
</script>
"""

_LEGEND = (
    '<div id="scancell-legend" role="note" aria-label="Legend" tabindex="0">%s</div>'
    '<div id="scancell-tip" aria-hidden="true"></div>'
)

_FOLLOW = r"""
<script>
(() => {
  const legend = document.getElementById("scancell-legend");
  // A page that is named in the address has the legend of its own story.
  const address = location.pathname.replace(/\/?$/, "/") + "legend";
  let tag = "";
  const follow = async () => {
    if (!document.hidden) {
      try {
        const answer = await fetch(address, tag ? { headers: { "If-None-Match": tag } } : {});
        if (answer.status === 200) {
          tag = answer.headers.get("ETag") ?? "";
          legend.innerHTML = await answer.text();
        }
      } catch {
        // The server is away; the scene itself shows that, and the next round asks again.
      }
    }
    setTimeout(follow, 1500);
  };
  follow();
})();
</script>
"""


@cache
def client_page(title: str = "Scene") -> str:
    """Return the page of a live scene."""
    import viser

    client = Path(viser.__file__).parent / "client" / "build" / "index.html"
    return _dressed(client.read_text(encoding="utf-8"), title, _START, _LEGEND % "" + _FOLLOW + _arranging())


@cache
def _arranging() -> str:
    """Return the script that keeps labels apart, axes of one size and the legend beside the picture."""
    text = (Path(__file__).parent / "arrange.js").read_text(encoding="utf-8")
    return f"<script>\n{text}</script>"


@cache
def page_tag() -> str:
    """Return the entity tag of `client_page`: a browser that has this page need not load it again."""
    return f'"{sha256(client_page().encode()).hexdigest()[:16]}"'


@cache
def content_security_policy() -> str:
    """Return the policy of `client_page`: of all that stands in a page, its own scripts alone run."""
    scripts = _Scripts()
    scripts.feed(client_page())
    return _POLICY % " ".join(
        f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'" for text in scripts.texts
    )


class _Scripts(HTMLParser):
    """Gathers the texts of a page's inline scripts."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=False)
        self.texts: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "script":
            self.texts.append("")

    def handle_data(self, data: str) -> None:
        if self.cdata_elem == "script":
            self.texts[-1] += data


def offline_page(scene_page: str, title: str, legend: str) -> str:
    """Return viser's self-contained page of a recorded scene with a title and a legend that stands still."""
    return _dressed(scene_page, title, _START, _LEGEND % legend + _arranging())


def _dressed(page: str, title: str, head: str, body: str) -> str:
    from html import escape

    page = page.replace("<title>Viser</title>", f"<title>{escape(title)}</title>", 1)
    at = page.index("<head>") + len("<head>")
    page = page[:at] + '<meta charset="utf-8" />' + _STYLE + head + page[at:]
    end = page.rindex("</body>")
    return page[:end] + body + page[end:]
