/** Moving a robot in the simulator: a ghost goes with the mouse, the robot moves when the button is released. */

import { normalize } from "../scene/camera.js";
import { inMetres, inPixels, label, trace } from "../scene/paint.js";
import { circle } from "../scene/polygons.js";

const TURN = Math.PI / 12;
/** Milliseconds for which a refused place stays marked. */
const REFUSED = 2000;

/** @typedef {{robot: number, x: number, y: number, yaw: number, offset: [number, number], state: "held" | "sent" |
 *   "refused"}} Ghost
 *  offset: from the mouse to the robot's origin */

/** @param {import("../app.js").App} app */
export function makeMoveTool(app) {
  /** @type {Ghost | null} */
  let ghost = null;

  /** @param {Ghost} sent */
  async function send(sent) {
    sent.state = "sent";
    const { robot, x, y, yaw } = sent,
      error = await app.ask({ op: "move", robot, x, y, yaw }, `Robot ${robot} was not moved`);
    if (ghost !== sent) return;
    if (!error) ghost = null;
    else {
      sent.state = "refused";
      setTimeout(() => {
        if (ghost === sent) ghost = null;
        app.scene?.requestDraw();
      }, REFUSED);
    }
    app.scene?.requestDraw();
  }

  return {
    /** @param {import("./pose.js").Point} point */
    down(point) {
      const pose = point.robot >= 0 ? app.store.poses.at(point.robot) : null;
      if (!pose) return false;
      app.select([point.robot]);
      ghost = {
        robot: point.robot,
        x: pose.x,
        y: pose.y,
        yaw: pose.yaw,
        offset: [pose.x - point.x, pose.y - point.y],
        state: "held",
      };
      return true;
    },
    /** @param {import("./pose.js").Point} point */
    move(point) {
      if (ghost?.state !== "held") return;
      ghost.x = point.x + ghost.offset[0];
      ghost.y = point.y + ghost.offset[1];
    },
    up() {
      if (ghost?.state === "held") send(ghost);
    },
    cancel() {
      ghost = null;
    },
    /** @param {number} steps @returns {boolean} whether the wheel was used */
    wheel(steps) {
      if (ghost?.state !== "held") return false;
      ghost.yaw = normalize(ghost.yaw + TURN * steps);
      return true;
    },
    /** @param {import("../scene/paint.js").Pen} pen */
    paint(pen) {
      if (!ghost) return;
      const { ctx, theme } = pen,
        robot = app.store.robots.get(ghost.robot);
      const color = ghost.state === "refused" ? theme.css.danger : theme.robotCss(ghost.robot);
      inMetres(pen, ghost.x, ghost.y, ghost.yaw);
      ctx.lineWidth = 2 / app.camera.scale;
      ctx.strokeStyle = ctx.fillStyle = color;
      const outline = robot?.outline.length ? robot.outline : [circle(pen.radius(ghost.robot))];
      for (const polygon of outline) {
        trace(ctx, polygon, true);
        ctx.globalAlpha = 0.3;
        ctx.fill();
        ctx.globalAlpha = 1;
        ctx.stroke();
      }
      inPixels(pen);
      const [px, py] = app.camera.toScreen(ghost.x, ghost.y);
      const text = ghost.state === "refused" ? "refused" : `${ghost.x.toFixed(2)}, ${ghost.y.toFixed(2)}`;
      label(pen, text, px, py - pen.radius(ghost.robot) * app.camera.scale - 14 * theme.textSize, {
        color: ghost.state === "refused" ? color : theme.css.text,
      });
    },
  };
}
