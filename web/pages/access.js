// Who may: an admin's page of tokens and of the log. The server answers nobody else.

import "../texts/later.js";
import { AuditLogElement } from "../account/audit-log.js";
import { TokensElement } from "../account/tokens.js";
import { h, make } from "../dom.js";
import { may, me } from "../state/me.js";
import { t } from "../texts.js";

export class AccessPage extends HTMLElement {
  connectedCallback() {
    document.title = t("access.page_title");
    if (!may("admin")) {
      this.append(h("section", { class: "lost" }, h("h1", {}, t("access.title")), h("p", {}, t("may.admin")), h("a", { href: "/" }, t("lost.back"))));
      return;
    }
    const log = make(AuditLogElement);
    this.append(
      h("h1", {}, t("access.title")), h("p", { class: "soft" }, t(me().login === "not-needed" ? "access.no_login" : "access.lead")),
      make(TokensElement, { changed: () => void log.refresh().catch(() => undefined) }), log);
  }
}

customElements.define("sc-access", AccessPage);
