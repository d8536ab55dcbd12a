/** Puts the panels together. */

import { FORMAT, Layout } from "../layout.js";
import { doctorTab } from "./doctor.js";
import { framesTab } from "./frames.js";
import { mountFrame } from "./frame.js";
import { mountGoals } from "./goals.js";
import { inspectorTab } from "./inspector.js";
import { mountKeys } from "./keys.js";
import { layersTab } from "./layers.js";
import { logTab } from "./log.js";
import { mountNoMap } from "./no_map.js";
import { mountNotices } from "./notices.js";
import { mountPageButtons, savePicture } from "./page_buttons.js";
import { plotsTab } from "./plots.js";
import { mountRecorded } from "./recorded.js";
import { mountSimulatorBar, simulatorTab } from "./simulator.js";
import { mountStopped } from "./stopped.js";
import { teamTab } from "./team.js";
import { watchTextSize } from "./text_size.js";
import { Theme } from "./theme.js";
import { topicsTab } from "./topics.js";

/** The camera's part before the user, an address or a layout has placed it. */
const UNPLACED = "0,0,0,0";

/** @param {import("../app.js").App} app */
export function mountPanels(app) {
  const layout = new Layout();
  const theme = new Theme(app.store);
  watchTextSize(app.store);
  layout.register("camera", cameraPart(app), UNPLACED);
  layout.register("selected", selectionPart(app), "");
  layout.register("theme", theme);
  for (const event of ["camera", "selection", "theme"]) app.store.on(event, () => layout.changed());
  const { tab: plotsPage, plots } = plotsTab(app, layout);
  let choose = (/** @type {string} */ _name) => {};
  const plot = (/** @type {string} */ topic, /** @type {string} */ field) => {
    plots.add(topic, field);
    choose("plots");
  };
  const show = (/** @type {string} */ panel, /** @type {Record<string, string>} */ parts) => {
    layout.apply({ version: FORMAT, ...parts });
    choose(panel);
  };
  const topics = topicsTab(app, layout, plot);
  const inspector = inspectorTab(app, {
    plot: (topic, field) => (plots.has(topic, field) ? plots.remove(topic, field) : plot(topic, field)),
    isPlotted: (topic, field) => plots.has(topic, field),
    echo: (topic) => show("topics", { echo: topic }),
    log: (process) => show("log", { log: `info/${process}/` }),
  });
  app.inspect = (robot) => {
    app.select([robot]);
    choose("robot");
  };
  // The clicks before have selected what is there.
  document.getElementById("scene")?.addEventListener("dblclick", ({ target }) => {
    if (target instanceof Element && target.closest("[data-own-pointer]")) return;
    const [robot, ...others] = app.store.selection;
    if (app.tool === "select" && robot !== undefined && !others.length) app.inspect(robot);
  });
  const side = [teamTab(app), inspector, simulatorTab(app), topics, framesTab(app), layersTab(app, layout)];
  const frame = mountFrame(side, [logTab(app, layout), plotsPage, doctorTab(app)], layout);
  choose = frame.choose;
  mountSimulatorBar(app);
  mountNotices(app);
  mountStopped(app);
  mountRecorded(app);
  const scene = /** @type {HTMLElement} */ (document.getElementById("scene"));
  if (!app.scene?.works) mountNoMap(scene, choose);
  mountGoals(app, scene);
  const foldAll = () => {
    const open = !(frame.side.open || frame.dock.open);
    frame.side.toggle(open);
    if (!open) frame.dock.toggle(false);
  };
  const showHelp = mountKeys(app, { choose, foldAll, picture: () => savePicture(app), theme: () => theme.toggle() });
  mountPageButtons(app, layout, theme, showHelp);
  layout.open().then((problem) => problem && app.say(problem, "error"));
  app.sayAll();
}

/** @param {import("../app.js").App} app @returns {import("../layout.js").Part} */
function cameraPart({ camera, scene }) {
  return {
    get: () => {
      const { x, y, scale, angle, follow } = camera.get();
      const zoom = `${Number(scale.toPrecision(4))},${Number(angle.toFixed(3))}`;
      if (!camera.placed) return UNPLACED;
      return follow >= 0 ? `robot ${follow},${zoom}` : `${x.toFixed(2)},${y.toFixed(2)},${zoom}`;
    },
    set: (text) => {
      const parts = text.split(","), robot = /^robot (\d+)$/.exec(parts[0]);
      if (text === UNPLACED) return scene?.keepTeam();
      const numbers = parts.slice(robot ? 1 : 0).map(Number);
      if (numbers.length !== (robot ? 2 : 4) || !numbers.every(Number.isFinite)) return;
      const [scale, angle] = numbers.slice(-2);
      camera.set(robot ? { follow: Number(robot[1]), scale, angle } : { x: numbers[0], y: numbers[1], scale, angle, follow: -1 });
    },
  };
}

/** @param {import("../app.js").App} app @returns {import("../layout.js").Part} */
function selectionPart(app) {
  return {
    get: () => [...app.store.selection].sort((a, b) => a - b).join(","),
    set: (text) => app.select(text.split(",").filter((id) => /^\d+$/.test(id)).map(Number)),
  };
}
