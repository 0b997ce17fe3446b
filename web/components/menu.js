// What lies behind ⋯: who one is, logging out, and the way to the API's documentation.

import { api } from "../state/api.js";
import { field, h } from "../dom.js";
import { when } from "../format.js";
import { icon } from "../icons.js";
import { may, me } from "../state/me.js";
import { atShop, letBeHeard, mayBeHeard, setShop } from "../shop.js";
import { chooseLanguage, language, LANGUAGES, t } from "../texts.js";
import { attempt } from "./toasts.js";

async function logOut() {
  if (await attempt(() => api.logOut())) window.location.assign("/login");
}

function who() {
  const { name, role, login } = me();
  if (login === "not-needed" || !role) return [h("p", { class: "soft small" }, t("menu.who_machine"))];
  return [
    h("p", {}, h("strong", {}, name), h("br"), h("span", { class: "soft small" }, t(`menu.role_${role}`))),
    login === "cookie" && h("button", { type: "button", onclick: () => void logOut() }, t("menu.log_out")),
  ];
}

/** Names of languages stand in their own language. */
function languages() {
  const select = h("select", { onchange: () => chooseLanguage(select.value) }, ...LANGUAGES.map((one) =>
    h("option", { value: one, lang: one, selected: one === language }, new Intl.DisplayNames([one], { type: "language" }).of(one) ?? one)));
  return field("language", t("menu.language"), select);
}

/** The mode for a tablet at arm's length. */
function shopFloor() {
  const box = h("input", { type: "checkbox", id: "shop", ".checked": atShop(), onchange: () => setShop(box.checked) });
  const heard = h("input", { type: "checkbox", id: "heard", ".checked": mayBeHeard(), onchange: () => letBeHeard(heard.checked) });
  return [h("div", { class: "row shop-choice" }, box, h("label", { for: "shop" }, t("menu.shop"))),
    h("div", { class: "row shop-choice shop-only" }, heard, h("label", { for: "heard" }, t("menu.sound")))];
}

/** What runs on which data, as the server has written it into the page. */
function version() {
  const [written, updated] = ["version", "data-updated"].map((name) => document.querySelector(`meta[name="${name}"]`)?.getAttribute("content"));
  return written && h("p", { class: "soft small" }, `scancell ${written}`, h("br"), updated ? t("menu.data_updated", { when: when(updated) }) : t("menu.data_current"));
}

/** The button and what it opens. */
export function menu() {
  const panel = h("div", { id: "menu", class: "menu", popover: "auto", role: "group", "aria-label": t("menu.open") },
    ...who(), h("button", { type: "button", class: "plain", onclick: async () => (await import("../measure/keys.js")).keysDialog() }, t("menu.keys"), h("kbd", { "aria-hidden": "true" }, "?")),
    languages(), ...shopFloor(),
    version(), h("a", { href: "/equipment" }, t("equipment.title")), may("admin") && h("a", { href: "/access" }, t("access.title")), h("a", { href: "/docs" }, t("menu.docs")));
  const button = h("button", { type: "button", class: "plain icon", popovertarget: "menu", "aria-label": t("menu.open"), title: t("menu.open") }, icon("more"));
  return [button, panel];
}
