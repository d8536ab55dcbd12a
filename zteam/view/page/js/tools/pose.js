/** Tools that give a pose: press for the place, drag for the heading. */

import { paintGoal } from "../scene/goals.js";

/** A drag of fewer pixels gives no heading. */
const MIN_DRAG = 8;

/** @typedef {import("../app.js").App} App */
/**
 * @typedef {{px: number, py: number, x: number, y: number, shift: boolean, robot: number}} Point pixels, map, and the
 *   robot there (-1: none)
 */

/**
 * @param {App} app
 * @param {(x: number, y: number, yaw: number | null) => void} give yaw is null after a click without a drag
 * @param {() => boolean} ready whether a press may begin; says why not itself
 */
export function makePoseTool(app, give, ready) {
  /** @type {{start: Point, yaw: number | null} | null} */
  let drag = null;
  return {
    /** @param {Point} point */
    down(point) {
      drag = ready() ? { start: point, yaw: null } : null;
    },
    /** @param {Point} point */
    move(point) {
      if (!drag) return;
      const { start } = drag;
      drag.yaw =
        Math.hypot(point.px - start.px, point.py - start.py) < MIN_DRAG
          ? null
          : Math.atan2(point.y - start.y, point.x - start.x);
    },
    up() {
      if (drag) give(drag.start.x, drag.start.y, drag.yaw);
      drag = null;
    },
    cancel() {
      drag = null;
    },
    /** @param {import("../scene/paint.js").Pen} pen */
    paint(pen) {
      if (drag) {
        paintGoal(pen, ...pen.app.camera.toScreen(drag.start.x, drag.start.y), drag.yaw ?? 0, pen.theme.css.accent);
      }
    },
  };
}

/**
 * The heading of a goal that was only clicked: on from the robot.
 * @param {App} app
 * @param {number[]} ids
 * @param {number} x
 * @param {number} y
 */
export function headingTo(app, ids, x, y) {
  const pose = ids.length === 1 ? app.store.poses.at(ids[0]) : null;
  return pose ? Math.atan2(y - pose.y, x - pose.x) : 0;
}

/**
 * The robots that a command is for: the selected ones, or the only one there is.
 * @param {App} app
 * @returns {number[]}
 */
export function chosenRobots({ store }) {
  if (store.selection.size) return [...store.selection].sort((a, b) => a - b);
  return store.robots.size === 1 ? [...store.robots.keys()] : [];
}

/** @param {App} app */
export function makeGoalTool(app) {
  return makePoseTool(
    app,
    async (x, y, yaw) => {
      const robots = chosenRobots(app);
      const error = await app.send({ op: "goal", robots, x, y, yaw: yaw ?? headingTo(app, robots, x, y) });
      if (error) app.say(`Goal: ${error}`, "error");
    },
    () => chosenRobots(app).length > 0 || refuse(app, "Goal: select the robots first (s)"),
  );
}

/** @param {App} app */
export function makeInitialPoseTool(app) {
  return makePoseTool(
    app,
    async (x, y, yaw) => {
      const [robot] = chosenRobots(app);
      const error = await app.send({ op: "initialpose", robot, x, y, yaw: yaw ?? app.store.poses.at(robot)?.yaw ?? 0 });
      app.say(error ? `Initial pose: ${error}` : `Initial pose sent to robot ${robot}`, error ? "error" : "info");
    },
    () => chosenRobots(app).length === 1 || refuse(app, "Initial pose: select one robot first (s)"),
  );
}

/** @param {App} app */
export function makeSpawnTool(app) {
  return makePoseTool(
    app,
    async (x, y, yaw) => {
      const error = await app.send({ op: "spawn", model: app.spawnModel, x, y, yaw: yaw ?? 0 });
      if (error) app.say(`Spawn: ${error}`, "error");
    },
    () => app.spawnModel !== "" || refuse(app, "Spawn: choose a model first"),
  );
}

/** @param {App} app @param {string} text @returns {false} */
function refuse(app, text) {
  app.say(text, "error");
  return false;
}
