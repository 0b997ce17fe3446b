// Addresses of the page: `/` and `/sessions/{id}`. The server serves the same document for both.

/** @typedef {{ page: "start" } | { page: "session", id: string } | { page: "unknown" }} Place */

/** @returns {Place} */
export function place(path = window.location.pathname) {
  if (path === "/" || path === "/index.html") return { page: "start" };
  const match = /^\/sessions\/([^/]+)\/?$/.exec(path);
  return match?.[1] ? { page: "session", id: decodeURIComponent(match[1]) } : { page: "unknown" };
}

/** @param {string} path */
export function go(path) {
  window.history.pushState(null, "", path);
  window.dispatchEvent(new PopStateEvent("popstate"));
}

/**
 * Call `show` now and at every change of address; links within the page need no reload.
 * @param {(place: Place) => void} show
 */
export function route(show) {
  let shown = "";
  const update = () => {
    if (window.location.pathname === shown) return;
    shown = window.location.pathname;
    show(place());
  };
  window.addEventListener("popstate", update);
  document.addEventListener("click", (event) => {
    const link = event.target instanceof Element ? event.target.closest("a") : null;
    const plain = !(event.ctrlKey || event.metaKey || event.shiftKey || event.altKey || event.button);
    if (!link || !plain || link.origin !== window.location.origin || link.target || link.download) return;
    if (place(link.pathname).page === "unknown" || link.hash) return;
    event.preventDefault();
    go(link.pathname);
  });
  update();
}
