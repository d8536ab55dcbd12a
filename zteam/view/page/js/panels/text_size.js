/** The browser's size of text, which its user may change at any time. */

import { el } from "../dom.js";

/** Pictures of text and charts are made anew when it changes, as when the colours do. @param {import("../store.js").Store} store */
export function watchTextSize(store) {
  const probe = el("div", { class: "unseen", "aria-hidden": "true" });
  probe.style.inlineSize = "1rem";
  document.body.append(probe);
  let known = probe.offsetWidth;
  new ResizeObserver(() => {
    if (probe.offsetWidth === known) return;
    known = probe.offsetWidth;
    store.emit("theme");
  }).observe(probe);
}
