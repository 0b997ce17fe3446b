// What lies behind ⋯: who one is, logging out, and the way to the API's documentation.

import { api } from "../api.js";
import { h } from "../dom.js";
import { icon } from "../icons.js";
import { may, me } from "../me.js";
import { t } from "../texts.js";
import { attempt } from "./toasts.js";

async function logOut() {
  if (await attempt(() => api.logOut())) window.location.assign("/login");
}

function who() {
  const { name, role, login } = me();
  if (login === "not-needed" || !role) return [h("p", { class: "soft small" }, t("menu.who_machine"))];
  return [
    h("p", {}, h("strong", {}, t("menu.who", { name })), h("br"), h("span", { class: "soft small" }, t(`menu.role_${role}`))),
    login === "cookie" && h("button", { type: "button", onclick: () => void logOut() }, t("menu.log_out")),
  ];
}

/** The button and what it opens. */
export function menu() {
  const panel = h("div", { id: "menu", class: "menu", popover: "auto", role: "group", "aria-label": t("menu.title") },
    ...who(), may("admin") && h("a", { href: "/access" }, t("access.title")), h("a", { href: "/docs" }, t("menu.docs")));
  const button = h("button", { type: "button", class: "plain icon", popovertarget: "menu", "aria-label": t("menu.open"), title: t("menu.open") }, icon("more"));
  return [button, panel];
}
