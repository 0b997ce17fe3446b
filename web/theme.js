// Light or dark: the system's choice until the user makes one.

const KEY = "scancell-theme";
const system = window.matchMedia("(prefers-color-scheme: dark)");
const changes = new EventTarget();

/** @typedef {"light" | "dark"} Theme */

/** @returns {Theme} */
export function theme() {
  const chosen = window.localStorage.getItem(KEY);
  if (chosen === "light" || chosen === "dark") return chosen;
  return system.matches ? "dark" : "light";
}

function apply() {
  document.documentElement.dataset["theme"] = theme();
  changes.dispatchEvent(new Event("change"));
}

export function switchTheme() {
  window.localStorage.setItem(KEY, theme() === "dark" ? "light" : "dark");
  apply();
}

/**
 * @param {() => void} listener
 * @returns {() => void} stop
 */
export function whenThemeChanges(listener) {
  changes.addEventListener("change", listener);
  return () => changes.removeEventListener("change", listener);
}

system.addEventListener("change", apply);
apply();
