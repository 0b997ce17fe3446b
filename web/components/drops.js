// Files dropped on a page: wherever they fall, the browser never leaves the page to show them.

import { allowed } from "../state/me.js";

/** What takes them. @type {{ element: HTMLElement, take: (data: DataTransfer) => void } | null} */
let taker = null;

/**
 * Have files that are dropped anywhere taken by who may take captures, as long as an element is shown; it says meanwhile that they may be.
 * @param {HTMLElement} element
 * @param {(data: DataTransfer) => void} take
 */
export function takeDrops(element, take) {
  taker = { element, take };
}

// Where the page moved under the pointer, the browser asks by `dragenter` alone whether a drop is taken.
for (const kind of /** @type {const} */ (["dragenter", "dragover"])) {
  document.addEventListener(kind, (event) => {
    if (!event.dataTransfer?.types.includes("Files")) return;
    event.preventDefault();
    taker?.element.classList.add("dropping");
  });
}
document.addEventListener("dragleave", (event) => {
  if (!event.relatedTarget) taker?.element.classList.remove("dropping");
});
document.addEventListener("drop", (event) => {
  if (!event.dataTransfer?.types.includes("Files")) return;
  event.preventDefault();
  taker?.element.classList.remove("dropping");
  if (taker?.element.isConnected && allowed("capture")) taker.take(event.dataTransfer);
});
