"""The legend: what the colours mean, with units, as HTML for the live scene and for the offline file."""

from html import escape

from server.scenes.colors import DIVERGING, LIGHT, REJECTED, USED, WAITING, Rgb, css, length_text
from server.scenes.facts import SceneFacts
from server.scenes.layers import Look


def legend_html(facts: SceneFacts, look: Look) -> str:
    """Return the legend of a scene; without a result it says what is still to come."""
    count = {state: sum(c.state == state for c in facts.captures) for state in ("used", "rejected", "waiting")}
    parts: list[str] = []
    if facts.sphere_center_in_base_mm is not None:
        parts.append(_scale(look.limit_mm))
        parts.append(_key(USED, "●", f"{count['used']} used"))
        if count["waiting"]:
            parts.append(_key(WAITING, "●", f"{count['waiting']} not in the result"))
    elif facts.captures:
        parts.append("<p>Only the flange is known so far. Scanner and sphere appear with the first result.</p>")
        parts.append(_key(WAITING, "●", _plural(count["waiting"], "capture")))
    else:
        parts.append("<p>No captures yet. They appear here as they come in.</p>")
    if count["rejected"]:
        parts.append(_key(REJECTED, "✕", f"{count['rejected']} rejected"))
    if facts.tool0_from_laser is not None:
        parts.append(_key(LIGHT, "◣", "plane of light"))
    return "".join(parts)


def rejected_html(facts: SceneFacts) -> str:
    """Return the list of rejected captures with their reasons in full, empty if there are none."""
    rows = [f"<li><b>{escape(c.id)}</b>: {escape(c.reason)}</li>" for c in facts.captures if c.state == "rejected"]
    if not rows:
        return ""
    return f'<ul style="margin:0;padding:0 1em 0.6em 2em;font-size:0.85em;line-height:1.4">{"".join(rows)}</ul>'


def _scale(limit_mm: float) -> str:
    stops = ", ".join(css(color) for color in DIVERGING)
    limit = length_text(limit_mm)
    return (
        "<h2>Distance to the sphere</h2>"
        f'<div class="bar" style="background:linear-gradient(to right, {stops})"></div>'
        f'<div class="ticks"><span>≤ −{limit}</span><span>0</span><span>≥ +{limit}</span></div>'
        '<div class="ticks"><span>inside</span><span>outside</span></div>'
    )


def _key(color: Rgb, sign: str, text: str) -> str:
    return f'<span class="key"><i style="color:{css(color)}">{sign}</i> {escape(text)}</span>'


def _plural(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
