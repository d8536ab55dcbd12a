/** In a browser that has no WebGL2: in place of the map what is missing, the way out, and the tables that work without. */

import { el } from "../dom.js";

const WAYS = [
  "Chrome, Edge, Chromium: switch on Settings → System → “Use graphics acceleration when available”, and start the browser again.",
  "Firefox: set webgl.disabled to false in about:config.",
  "On a machine without a graphics card: start Chromium with --enable-unsafe-swiftshader, which draws in software.",
  "Or open the address in a browser on another machine; zteam view --host 0.0.0.0 lets it in.",
];
const TABLES = { team: "Team", topics: "Topics", frames: "Frames", log: "Log" };

/** @param {HTMLElement} scene the map's place @param {(panel: string) => void} choose opens a panel */
export function mountNoMap(scene, choose) {
  const tables = Object.entries(TABLES).map(([name, title]) => el("button", { type: "button", onclick: () => choose(name) }, title));
  // What lies below would take the keyboard.
  scene.inert = true;
  scene.after(
    el("section", { id: "no-map", "aria-label": "No map" },
      el("h1", {}, "This browser has no WebGL2, so there is no map"),
      el("p", {}, "The tables, the log, the plots and the simulator's controls work without it:"),
      el("div", { class: "row" }, ...tables),
      el("p", {}, "Ways to the map:"),
      el("ul", {}, ...WAYS.map((way) => el("li", {}, way)))),
  );
}
