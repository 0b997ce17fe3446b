// The login page: a token in, and on to where one wanted to go.

import "./theme.js";
import { api } from "./state/api.js";
import { Problem } from "./state/http.js";
import { h } from "./dom.js";
import { t } from "./texts.js";

/** Where to go afterwards: a page of this server, whatever the address says. */
function destination() {
  const wanted = new URLSearchParams(window.location.search).get("next") ?? "/";
  const url = new URL(wanted, window.location.origin);
  const own = url.origin === window.location.origin && url.pathname !== "/login";
  return own ? url.pathname + url.search + url.hash : "/";
}

const hasEnded = new URLSearchParams(window.location.search).has("ended");
const problem = h("p", { class: "form-problem", role: "alert", id: "login-problem", hidden: true });
const field = h("input", {
  id: "token", name: "token", type: "password", required: true, autocomplete: "current-password", spellcheck: "false",
  autocapitalize: "none", "aria-describedby": "token-hint login-problem",
});
const button = h("button", { type: "submit", class: "primary" }, t("login.go"));

/** @param {SubmitEvent} event */
async function submit(event) {
  event.preventDefault();
  if (button.disabled) return;
  button.disabled = true;
  problem.hidden = true;
  try {
    await api.logIn(field.value.trim());
    window.location.replace(destination());
  } catch (error) {
    if (!(error instanceof Problem)) throw error;
    problem.textContent = error.message;
    problem.hidden = false;
    field.setAttribute("aria-invalid", "true");
    field.select();
    field.focus();
  } finally {
    button.disabled = false;
  }
}

function form() {
  return h("form", { onsubmit: submit },
    h("div", { class: "field" },
      h("label", { for: "token" }, t("login.token")),
      field,
      h("span", { class: "hint", id: "token-hint" }, t("login.hint"))),
    problem,
    h("div", { class: "row" }, button));
}

// Who comes from another site is logged in already, perhaps: that request carried no cookie, this one does.
const me = await api.me().catch(() => null);
if (me?.role) window.location.replace(destination());
else {
  document.body.append(
    h("header", { class: "top" }, h("span", { class: "name" }, "scancell")),
    h("main", { class: "login" },
      h("h1", {}, t("login.title")), hasEnded && h("p", { class: "form-problem", role: "status" }, t("problem.login_ended")), form(),
      h("details", {}, h("summary", {}, t("login.how")), h("p", { class: "soft small" }, t("login.how_words")),
        h("pre", { class: "mono small" }, "scancell token create --role capture --name NAME"))),
  );
  field.focus();
}
