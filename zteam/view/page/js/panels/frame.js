/** Where the panels stand: beside the map and below it, or on a narrow screen all in one drawer. */

import { el } from "../dom.js";
import { Tabs } from "./tabs.js";

const NARROW = "(max-width: 47.5em)";

/** Sizes in CSS pixels that the user may drag to. */
const SIDE = { property: "--panel-width", smallest: 280, normal: 408 };
const DOCK = { property: "--dock-height", smallest: 120, normal: 250 };

/**
 * @param {import("./tabs.js").Tab[]} side
 * @param {import("./tabs.js").Tab[]} below
 * @param {import("../layout.js").Layout} layout
 * @returns {{side: Tabs, dock: Tabs, choose: (name: string) => void}}
 */
export function mountFrame(side, below, layout) {
  const changed = () => layout.changed();
  const aside = /** @type {HTMLElement} */ (document.getElementById("panel"));
  const dock = /** @type {HTMLElement} */ (document.getElementById("dock"));
  const sideTabs = new Tabs(aside, "Panels", changed), dockTabs = new Tabs(dock, "Log and plots", changed);
  const narrow = matchMedia(NARROW);
  const place = () => {
    // A page leaves one place before it enters the other.
    dockTabs.setTabs(narrow.matches ? [] : below);
    sideTabs.setTabs(narrow.matches ? [...side, ...below] : side);
  };
  sideTabs.open = !narrow.matches;
  dockTabs.open = false;
  narrow.addEventListener("change", place);
  place();
  addGrip(aside, SIDE, "Width of the panels", (event) => window.innerWidth - event.clientX);
  addGrip(dock, DOCK, "Height of log and plots", (event) => dock.getBoundingClientRect().bottom - event.clientY);
  layout.register("side", sideTabs);
  layout.register("dock", dockTabs);
  const choose = (/** @type {string} */ name) => {
    const tabs = narrow.matches || side.some((tab) => tab.name === name) ? sideTabs : dockTabs;
    tabs.choose(name);
  };
  return { side: sideTabs, dock: dockTabs, choose };
}

/**
 * A border that can be dragged, or moved by the arrow keys.
 *
 * @param {HTMLElement} place
 * @param {typeof SIDE} size
 * @param {string} label
 * @param {(event: PointerEvent) => number} measure the size with the border under the pointer
 */
function addGrip(place, size, label, measure) {
  const grip = el("div", { class: "grip", role: "separator", tabindex: 0, "aria-label": label, "aria-orientation": size === SIDE ? "vertical" : "horizontal", "aria-valuemin": size.smallest });
  let current = size.normal;
  const largest = () => Math.round(0.7 * (size === SIDE ? window.innerWidth : window.innerHeight));
  const set = (/** @type {number} */ wanted) => {
    current = Math.round(Math.min(Math.max(wanted, size.smallest), largest()));
    document.documentElement.style.setProperty(size.property, `${current}px`);
    tell();
  };
  const tell = () => {
    grip.setAttribute("aria-valuenow", String(current));
    grip.setAttribute("aria-valuemax", String(largest()));
  };
  grip.addEventListener("pointerdown", (event) => {
    grip.setPointerCapture(event.pointerId);
    event.preventDefault();
  });
  grip.addEventListener("pointermove", (event) => grip.hasPointerCapture(event.pointerId) && set(measure(event)));
  grip.addEventListener("dblclick", () => set(size.normal));
  grip.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: 16, ArrowUp: 16, ArrowRight: -16, ArrowDown: -16 }[event.key];
    if (step) set(current + step);
  });
  tell();
  place.append(grip);
}
