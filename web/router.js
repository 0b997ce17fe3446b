// Addresses of the page: `/`, `/sessions/{id}`, its `/review`, `/compare`, `/access` and `/equipment`. The server serves one document for all.

/** @typedef {{ page: "start" | "compare" | "access" | "equipment" } | { page: "session" | "review", id: string } | { page: "unknown" }} Place */

/** @returns {Place} */
export function place(path = window.location.pathname) {
  if (path === "/" || path === "/index.html") return { page: "start" };
  if (path === "/compare") return { page: "compare" };
  if (path === "/access" || path === "/equipment") return { page: path === "/access" ? "access" : "equipment" };
  const match = /^\/sessions\/([^/]+?)(\/review)?\/?$/.exec(path);
  if (!match?.[1]) return { page: "unknown" };
  return { page: match[2] ? "review" : "session", id: decodeURIComponent(match[1]) };
}

/** @param {string} path */
export function go(path) {
  window.history.pushState(null, "", path);
  window.dispatchEvent(new PopStateEvent("popstate"));
}

/**
 * Call `show` now and at every change of address; links within the page need no reload.
 * @param {(place: Place) => void | Promise<void>} show
 */
export function route(show) {
  let shown = "";
  const update = () => {
    const { pathname, search } = window.location;
    const now = place(pathname).page === "compare" ? pathname + search : pathname;
    if (now === shown) return;
    shown = now;
    void show(place());
  };
  window.addEventListener("popstate", update);
  document.addEventListener("click", (event) => {
    const link = event.target instanceof Element ? event.target.closest("a") : null;
    const plain = !(event.ctrlKey || event.metaKey || event.shiftKey || event.altKey || event.button);
    if (!link || !plain || link.origin !== window.location.origin || link.target || link.download) return;
    if (place(link.pathname).page === "unknown" || link.hash) return;
    event.preventDefault();
    go(link.pathname + link.search);
  });
  update();
}
