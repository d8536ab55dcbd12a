/** Keys of the map, while no robot is driven. */

import { whyNoTool } from "../rights.js";
import { normalize } from "../scene/camera.js";

const TOOL_KEYS = /** @type {Record<string, string>} */ ({
  s: "select",
  g: "goal",
  p: "pose",
  v: "move",
  r: "measure",
});
/** Inputs that no text goes into. */
const WITHOUT_TEXT = ["checkbox", "radio", "range", "color", "file", "button", "submit", "reset"];
const STEP = 60;
const TURN = Math.PI / 12;
const ZOOM = 1.25;

/**
 * Whether a key is meant for a field that takes text, or for a dialogue that is open, not for the map: a checkbox or a
 * list that was clicked last keeps the focus, and takes no shortcut away.
 * @param {Event} event
 */
export function isTyped({ target }) {
  if (document.querySelector("dialog[open]")) return true;
  if (target instanceof HTMLInputElement && WITHOUT_TEXT.includes(target.type)) return false;
  return target instanceof Element && target.closest("input, textarea, [contenteditable]") !== null;
}

/** Follow the selected robot with the camera, or no longer. @param {import("../app.js").App} app */
export function toggleFollow(app) {
  const [first] = app.store.selection;
  if (app.camera.follow >= 0) return app.camera.set({ follow: -1 });
  if (first === undefined) return app.say("Follow: select a robot first (s)", "error");
  const pose = app.store.poses.at(first);
  app.camera.set(pose ? { x: pose.x, y: pose.y, follow: first } : { follow: first });
}

/**
 * @param {import("../app.js").App} app
 * @param {ReturnType<typeof import("./cursor.js").makeCursor>} cursor takes keys first, while the map has the focus
 * @param {() => void} cancel what goes on
 */
export function listenToKeys(app, cursor, cancel) {
  const { camera } = app;
  /** About the cursor, or the middle. @param {number} factor @param {number} [turn] */
  const zoom = (factor, turn) => camera.zoom(...(cursor.place() ?? [camera.width / 2, camera.height / 2]), factor, turn);
  /** @type {Record<string, () => void>} */
  const actions = {
    Escape: cancel,
    d: () => app.drive?.set(true),
    f: () => app.scene?.keepTeam(),
    Home: () => app.scene?.fit(),
    F: () => toggleFollow(app),
    n: () => zoom(1, -normalize(camera.angle)),
    "+": () => zoom(ZOOM),
    "=": () => zoom(ZOOM),
    "-": () => zoom(1 / ZOOM),
    "[": () => zoom(1, TURN),
    "]": () => zoom(1, -TURN),
    ArrowLeft: () => camera.pan(STEP, 0),
    ArrowRight: () => camera.pan(-STEP, 0),
    ArrowUp: () => camera.pan(0, STEP),
    ArrowDown: () => camera.pan(0, -STEP),
  };
  for (const [key, tool] of Object.entries(TOOL_KEYS)) {
    actions[key] = () => {
      const why = whyNoTool(app, tool);
      if (why) app.say(`${tool[0].toUpperCase()}${tool.slice(1)}: ${why}`, "error");
      else app.useTool(tool);
    };
  }

  window.addEventListener("keydown", (event) => {
    if (app.drive?.mode || event.defaultPrevented || isTyped(event) || event.altKey || event.metaKey) return;
    if (cursor.key(event)) return event.preventDefault();
    if (event.ctrlKey) {
      if (event.key !== "a") return;
      event.preventDefault();
      return app.select(app.store.poses.index.keys());
    }
    const act = actions[event.key];
    if (!act || (isOnControl(event) && /^Arrow|^Home$/.test(event.key))) return;
    event.preventDefault();
    act();
  });
}

/** Arrows move between the buttons and rows of a panel, not the map. @param {KeyboardEvent} event */
export function isOnControl({ target }) {
  if (!(target instanceof Element) || target.id === "map") return false;
  return target.closest("button, a, input, select, [tabindex], #panel, #dock") !== null;
}
