// Parts of a page that are loaded once they are nearly in sight: a first look does without them.

import { h } from "../dom.js";
import { loaded } from "../state/http.js";
import { attempt } from "./toasts.js";

const NEAR = "300px";

/** A place for a part, which comes into it once it is near; who keeps the place keeps the part. @param {() => Promise<HTMLElement>} make */
export function later(make) {
  const place = h("div", { class: "later" });
  const watch = new IntersectionObserver((seen) => {
    if (!seen.some(({ isIntersecting }) => isIntersecting)) return;
    watch.disconnect();
    void attempt(async () => place.append(await loaded(make)));
  }, { rootMargin: NEAR });
  watch.observe(place);
  return place;
}
