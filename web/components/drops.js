// Files dropped on a page.

import { allowed } from "../state/me.js";

/**
 * Have what is dropped anywhere on an element taken by who may take captures; the element says meanwhile that it may be.
 * @param {HTMLElement} element
 * @param {(data: DataTransfer) => void} take
 */
export function takeDrops(element, take) {
  element.addEventListener("dragover", (event) => {
    event.preventDefault();
    element.classList.add("dropping");
  });
  element.addEventListener("dragleave", (event) => {
    if (!(event.relatedTarget instanceof Node && element.contains(event.relatedTarget))) element.classList.remove("dropping");
  });
  element.addEventListener("drop", (event) => {
    event.preventDefault();
    element.classList.remove("dropping");
    if (event.dataTransfer && allowed("capture")) take(event.dataTransfer);
  });
}
