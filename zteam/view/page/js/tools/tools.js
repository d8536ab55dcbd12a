/** The tools of the map: one of them takes the mouse. */

import { makeCursor } from "./cursor.js";
import { cancelGoals, liveGoals } from "../goals.js";
import { makeMeasureTool } from "./measure.js";
import { makeMoveTool } from "./move.js";
import { listenToPointer } from "./pointer.js";
import { makeGoalTool, makeInitialPoseTool, makeSpawnTool } from "./pose.js";
import { makeSelectTool } from "./select.js";
import { whyNoCommand } from "../rights.js";
import { mountToolbar } from "./toolbar.js";
import { listenToKeys } from "./keys.js";

/** @param {import("../app.js").App} app @param {HTMLElement} element the map area @param {HTMLElement} bar */
export function mountTools(app, element, bar) {
  /** @type {Record<string, import("./pointer.js").Tool>} */
  const tools = {
    select: makeSelectTool(app),
    goal: makeGoalTool(app),
    pose: makeInitialPoseTool(app),
    move: makeMoveTool(app),
    measure: makeMeasureTool(app),
    spawn: makeSpawnTool(app),
  };
  const pointer = listenToPointer(app, element, () => tools[app.tool]);
  const [map, said] = ["map", "map-cursor"].map((id) => /** @type {HTMLElement} */ (document.getElementById(id)));
  const cursor = makeCursor(app, map, said, () => tools[app.tool]);
  let used = app.tool;
  app.store.on("tool", (name) => {
    pointer.cancel();
    cursor.cancel();
    tools[used].cancel();
    used = name;
    element.dataset.tool = name;
  });
  app.scene?.painters.push((pen) => tools[app.tool].paint(pen), cursor.paint);
  const cancel = () => {
    const pressed = [pointer.cancel(), cursor.cancel()].includes(true),
      idle = !pressed && app.tool === "select";
    tools[app.tool].cancel();
    app.useTool("select");
    const robots = idle && !whyNoCommand(app.store) ? liveGoals(app.store).map(({ robot }) => robot) : [];
    const chosen = robots.filter((robot) => app.store.selection.has(robot));
    if (chosen.length) cancelGoals(app, chosen);
  };
  listenToKeys(app, cursor, cancel);
  mountToolbar(app, bar);
}
