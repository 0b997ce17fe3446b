// The page: a frame that stays, and in it what its address names.

import "./theme.js";
import "./components/drops.js";
import "./shop.js";
import { h } from "./dom.js";
import { icon } from "./icons.js";
import { learn, whenRefused } from "./state/me.js";
import { place as placeAsked, route } from "./router.js";
import { loaded } from "./state/http.js";
import { switchTheme, theme, whenThemeChanges } from "./theme.js";
import { t } from "./texts.js";
import { menu } from "./components/menu.js";
import { forgive, install, notify } from "./components/toasts.js";

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
 * What an address shows; a page's code is loaded when it is first needed.
 * @param {Place} place
 * @returns {Promise<HTMLElement>}
 */
async function pageOf(place) {
  if (place.page === "start") return new (await loaded(() => import("./pages/start.js"))).StartPage();
  if (place.page === "session") return Object.assign(new (await loaded(() => import("./pages/session.js"))).SessionPage(), { sessionId: place.id, top: middle });
  if (place.page === "review") return Object.assign(new (await loaded(() => import("./pages/review.js"))).ReviewPage(), { sessionId: place.id, top: middle });
  if (place.page === "access") return new (await loaded(() => import("./pages/access.js"))).AccessPage();
  if (place.page === "equipment") return new (await loaded(() => import("./pages/equipment.js"))).EquipmentPage();
  if (place.page === "compare") return new (await loaded(() => import("./pages/compare.js"))).ComparePage();
  return h("section", { class: "lost" }, h("h1", {}, t("lost.title")), h("p", {}, t("lost.words")), h("a", { href: "/" }, t("lost.back")));
}

// What one may do decides what the page offers, so this comes first; the page's code is on its way meanwhile.
const { page: asked } = placeAsked();
if (asked === "start" || asked === "session") void import(`./pages/${asked}.js`);
await learn();
document.body.append(
  h("a", { class: "skip", href: "#main" }, t("skip")),
  h("header", { class: "top" }, h("a", { class: "name", href: "/" }, "scancell"), middle, themeButton(), ...menu()),
  main,
);
install(main);
whenRefused((reason) => notify(reason));
let shown = 0;
route(async (place) => {
  const turn = ++shown;
  const page = await pageOf(place);
  if (turn !== shown) return; // another address was taken meanwhile
  middle.replaceChildren();
  forgive(() => true);
  document.title = "scancell";
  main.replaceChildren(page);
  // A new page begins where its content begins, for who listens to it as well.
  if (turn > 1) main.focus();
});
