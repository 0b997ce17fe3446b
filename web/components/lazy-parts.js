// Parts of a page that are loaded once they are nearly in sight: a first look does without them.

import { h } from "../dom.js";
import { attempt } from "./toasts.js";

const NEAR = "300px";

/** A place for a part, and the part in it once it is near. @param {() => Promise<HTMLElement>} make */
export function later(make) {
  const place = h("div", { class: "later" });
  const watch = new IntersectionObserver((seen) => {
    if (!seen.some(({ isIntersecting }) => isIntersecting)) return;
    watch.disconnect();
    void attempt(async () => place.replaceWith(await make()));
  }, { rootMargin: NEAR });
  watch.observe(place);
  return place;
}
