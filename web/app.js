// The page: a frame that stays, and in it what its address names.

import "./theme.js";
import { h } from "./dom.js";
import { icon } from "./icons.js";
import { learn, whenRefused } from "./me.js";
import { route } from "./router.js";
import { switchTheme, theme, whenThemeChanges } from "./theme.js";
import { t } from "./texts.js";
import { menu } from "./components/menu.js";
import { install, notify } from "./components/toasts.js";
import { StartPage } from "./pages/start.js";
import { ComparePage } from "./pages/compare.js";
import { ReviewPage } from "./pages/review.js";
import { SessionPage } from "./pages/session.js";

/** @import {Place} from "./router.js" */

const middle = h("div", { class: "top-middle", id: "top-middle" });
const main = h("main", { id: "main", tabindex: -1 });

function themeButton() {
  const button = h("button", { type: "button", class: "plain icon", onclick: switchTheme });
  const show = () => {
    const label = t(theme() === "dark" ? "theme.to_light" : "theme.to_dark");
    button.setAttribute("aria-label", label);
    button.title = label;
    button.replaceChildren(icon(theme() === "dark" ? "sun" : "moon"));
  };
  whenThemeChanges(show);
  show();
  return button;
}

/**
 * @param {Place} place
 * @returns {HTMLElement}
 */
function pageOf(place) {
  if (place.page === "start") return new StartPage();
  if (place.page === "session") return Object.assign(new SessionPage(), { sessionId: place.id, top: middle });
  if (place.page === "review") return Object.assign(new ReviewPage(), { sessionId: place.id, top: middle });
  if (place.page === "compare") return new ComparePage();
  return h("section", { class: "lost" }, h("h1", {}, t("lost.title")), h("p", {}, t("lost.words")), h("a", { href: "/" }, t("lost.back")));
}

// What one may do decides what the page offers, so this comes first.
await learn();
document.body.append(
  h("a", { class: "skip", href: "#main" }, t("skip")),
  h("header", { class: "top" }, h("a", { class: "name", href: "/" }, "scancell"), middle, themeButton(), ...menu()),
  main,
);
install(document.body);
whenRefused((reason) => notify(reason));
let first = true;
route((place) => {
  middle.replaceChildren();
  main.replaceChildren(pageOf(place));
  document.title = "scancell";
  // A new page begins where its content begins, for who listens to it as well.
  if (!first) main.focus();
  first = false;
});
