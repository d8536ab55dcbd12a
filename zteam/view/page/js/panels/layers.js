/** Which layers the map shows, and where it looks. */

import { LAYERS } from "../layers.js";
import { el } from "./dom.js";

/** @param {import("../app.js").App} app @param {import("../layout.js").Layout} layout @returns {import("./tabs.js").Tab} */
export function layersTab(app, layout) {
  const boxes = new Map(LAYERS.map(({ name }) => {
    const box = el("input", { type: "checkbox", id: `layer-${name}` });
    box.addEventListener("change", () => app.layers.set(name, box.checked));
    return [name, box];
  }));
  const rows = LAYERS.map(({ name, title }) => el("label", { class: "check" }, /** @type {HTMLInputElement} */ (boxes.get(name)), title));
  const fit = el("button", { type: "button", onclick: () => /** @type {any} */ (app).scene?.fit() }, "Fit the map");
  const north = el("button", { type: "button", onclick: () => app.camera.set({ angle: 0 }) }, "Turn x to the right");
  const page = el("div", { class: "page" }, el("div", { class: "scroll" }, el("div", { class: "row under" }, fit, north), el("div", { class: "checks" }, ...rows)));
  const show = () => {
    for (const [name, box] of boxes) box.checked = app.layers.has(name);
    layout.changed();
  };
  app.store.on("layers", show);
  show();
  layout.register("layers", {
    get: () => LAYERS.filter(({ name }) => app.layers.has(name)).map(({ name }) => name).join(","),
    set: (text) => LAYERS.forEach(({ name }) => app.layers.set(name, text.split(",").includes(name))),
  });
  return { name: "layers", title: "Layers", page };
}
