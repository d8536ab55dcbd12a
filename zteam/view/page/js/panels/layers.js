/** Which layers the map shows, how opaque and of which robots, and where it looks. */

import { GROUPS, LAYERS, LEAST_OPACITY } from "../layers.js";
import { el, reconcile, setText } from "../dom.js";

/** @typedef {{element: HTMLElement, show: () => void}} Part */

/** @param {import("../app.js").App} app @param {import("../layout.js").Layout} layout @returns {import("./tabs.js").Tab} */
export function layersTab(app, layout) {
  const { layers } = app;
  const fit = el("button", { type: "button", onclick: () => app.scene?.fit() }, "Show the whole map");
  const north = el("button", { type: "button", onclick: () => app.camera.set({ angle: 0 }) }, "Turn the map back");
  const parts = GROUPS.map((group) => groupPart(app, group));
  const page = el("div", { class: "page" }, el("div", { class: "scroll" }, el("div", { class: "row under" }, fit, north), ...parts.map(({ element }) => element)));
  let open = false;
  const show = () => {
    if (open) for (const part of parts) part.show();
  };
  app.store.on("team", show);
  app.store.on("layers", () => {
    show();
    layout.changed();
  });
  layout.register("layers", {
    get: () => LAYERS.filter(({ name }) => layers.has(name)).map(({ name }) => name).join(","),
    set: (text) => LAYERS.forEach(({ name }) => layers.set(name, text.split(",").includes(name))),
  });
  layout.register("styles", { get: () => layers.styles, set: (text) => { layers.styles = text; } });
  return { name: "layers", title: "Layers", page, shown: (on) => { open = on; show(); } };
}

/** @param {import("../app.js").App} app @param {typeof GROUPS[number]} group @returns {Part} */
function groupPart(app, { name, title, perRobot }) {
  const parts = LAYERS.filter((layer) => layer.group === name).map((layer) => layerPart(app, layer));
  if (perRobot) parts.push(robotsPart(app, name, title));
  const element = el("section", { class: "layers", "aria-label": title }, el("h3", {}, title), ...parts.map((part) => part.element));
  return { element, show: () => parts.forEach((part) => part.show()) };
}

/** A layer's box and the slider of its opacity. @param {import("../app.js").App} app @param {import("../layers.js").Layer} layer @returns {Part} */
function layerPart({ layers }, { name, title, opacity }) {
  const box = el("input", { type: "checkbox", id: `layer-${name}`, onchange: () => layers.set(name, box.checked) });
  const slider = el("input", { type: "range", min: LEAST_OPACITY, max: 100, step: 5, "aria-label": `Opacity of ${title}` }), percent = el("output");
  slider.addEventListener("input", () => layers.setOpacity(name, slider.valueAsNumber));
  const parts = opacity === undefined ? [] : [slider, percent];
  const show = () => {
    box.checked = layers.has(name);
    const text = `${layers.opacity(name)} %`;
    slider.disabled = !box.checked;
    if (slider.valueAsNumber !== layers.opacity(name)) slider.value = String(layers.opacity(name));
    slider.setAttribute("aria-valuetext", text);
    setText(percent, text);
  };
  return { element: el("div", { class: "layer" }, el("label", { class: "check" }, box, title), ...parts), show };
}

/** The robots whose layers of a group are shown. @param {import("../app.js").App} app @param {string} group @param {string} title @returns {Part} */
function robotsPart(app, group, title) {
  const { layers, store } = app;
  const ids = () => [...store.robots.keys()];
  const choose = (/** @type {(id: number) => boolean} */ shown) => layers.hideRobots(group, ids().filter((id) => !shown(id)));
  const button = (/** @type {string} */ text, /** @type {(id: number) => boolean} */ shown) => el("button", { type: "button", onclick: () => choose(shown) }, text);
  const selected = button("Only selected", (id) => store.selection.has(id));
  const checks = el("div", { class: "checks" }), summary = el("summary");
  const element = el("details", { "aria-label": `Robots: ${title}` }, summary, el("div", { class: "row" }, button("All", () => true), button("None", () => false), selected), checks);
  const create = (/** @type {import("../store.js").Robot} */ robot) => {
    const box = el("input", { type: "checkbox" });
    box.addEventListener("change", () => {
      const hidden = new Set(layers.hiddenRobots(group));
      if (box.checked) hidden.delete(robot.id);
      else hidden.add(robot.id);
      layers.hideRobots(group, hidden);
    });
    return el("label", { class: "check" }, box, robot.name);
  };
  const show = () => {
    const robots = [...store.robots.values()], shown = robots.filter(({ id }) => layers.showsRobot(group, id)).length;
    setText(summary, `Robots: ${shown === robots.length ? "all" : `${shown} of ${robots.length}`}`);
    // The list of a hundred robots is made when it is opened.
    if (!element.open) return;
    reconcile(checks, robots, ({ id }) => String(id), create, (label, { id }) => {
      /** @type {HTMLInputElement} */ (label.firstElementChild).checked = layers.showsRobot(group, id);
    });
  };
  element.addEventListener("toggle", show);
  return { element, show };
}
