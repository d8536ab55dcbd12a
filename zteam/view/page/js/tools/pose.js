/** Tools that give a pose: press for the place, drag for the heading. */

import { judge } from "../costs.js";
import { watchGoal } from "../goals.js";
import { paintGoal } from "../scene/goals.js";
import { label, labelWhereFree, spriteOf } from "../scene/paint.js";

/** A drag of fewer pixels gives no heading. */
const MIN_DRAG = 8;
/** A second press within so many ms and pixels sends a goal that was not sent at the first one. */
const ASK_LIMIT = 15000;
const SAME = 15;

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

/**
 * A goal where a robot cannot stand is sent by a second press at the same place: the map may be wrong or old.
 * @param {App} app
 */
export function makeGoalTool(app) {
  /** @type {Point | null} where the pointer is */
  let at = null;
  /** @type {{x: number, y: number, time: number} | null} the place of the press that was not sent */
  let asked = null;

  /** Whether to send it; if not it says why. @param {number[]} robots @param {number} x @param {number} y */
  function isMeant(robots, x, y) {
    const found = judge(app.store, robots, x, y),
      now = performance.now(),
      before = asked;
    asked = null;
    if (!found?.bad) return true;
    const isSecond = before !== null && now - before.time < ASK_LIMIT && Math.hypot(x - before.x, y - before.y) * app.camera.scale < SAME;
    if (isSecond) app.say(`Goal sent, though it is not free: ${found.text}`, "info", "goal");
    else app.say(`Goal not sent: ${found.text}. Press again at the same place to send it anyway`, "error", "goal");
    asked = isSecond ? null : { x, y, time: now };
    return isSecond;
  }

  const tool = makePoseTool(
    app,
    (x, y, yaw) => {
      const robots = chosenRobots(app);
      if (!isMeant(robots, x, y)) return;
      app.ask({ op: "goal", robots, x, y, yaw: yaw ?? headingTo(app, robots, x, y) }, "Goal");
      if (robots.length === 1) watchGoal(app, robots[0], x, y);
    },
    () => chosenRobots(app).length > 0 || refuse(app, "Goal: select the robots first (s)"),
  );
  return {
    ...tool,
    /** @param {Point | null} point */
    hover(point) {
      at = point;
    },
    /** @param {Point} point */
    down(point) {
      at = point;
      tool.down(point);
    },
    cancel() {
      asked = at = null;
      tool.cancel();
    },
    /** @param {import("../scene/paint.js").Pen} pen */
    paint(pen) {
      tool.paint(pen);
      // The camera may have moved under the pointer.
      const found = at && judge(app.store, chosenRobots(app), ...app.camera.toMap(at.px, at.py));
      if (!at || !found) return;
      const { css, textSize } = pen.theme,
        { px, py } = at,
        down = 16 * textSize;
      const look = { bold: found.bad, color: found.bad ? css.danger : css.text },
        half = 14 + spriteOf(pen, found.text, look).width / 2;
      /** @type {[number, number][]} */
      const places = [[px + half, py + down], [px - half, py + down], [px + half, py - down], [px - half, py - down]];
      if (!labelWhereFree(pen, found.text, places, look)) label(pen, found.text, ...places[0], look);
    },
  };
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
    (x, y, yaw) => app.ask({ op: "spawn", model: app.spawnModel, behavior: app.spawnBehavior, x, y, yaw: yaw ?? 0 }, "Spawn"),
    () => app.spawnModel !== "" || refuse(app, "Spawn: choose a model first"),
  );
}

/** @param {App} app @param {string} text @returns {false} */
function refuse(app, text) {
  app.say(text, "error");
  return false;
}
