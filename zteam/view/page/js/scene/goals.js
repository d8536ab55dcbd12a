/** Goals that last: a ring with a heading in the robot's colour, a dashed line from the robot, and how far it is. */

import { liveGoals, progressText } from "../goals.js";
import { ahead, arrow, isOnScreen, labelWhereFree } from "./paint.js";

/** With more goals only those of selected robots say how far it is. */
const MOST_TEXTS = 30;
/** Pixels from a goal to the edge of its text, and half the height of that. */
const BESIDE = 9,
  HALF = 9;

/** @param {import("./paint.js").Pen} pen */
export function paintGoals(pen) {
  const { app, ctx, theme } = pen,
    goals = liveGoals(app.store).filter(({ robot }) => app.layers.showsRobot("navigation", robot)),
    { selection } = app.store;
  // Those of selected robots have their places first.
  goals.sort((a, b) => Number(selection.has(b.robot)) - Number(selection.has(a.robot)));
  for (const goal of goals) {
    const { robot, x, y, yaw } = goal;
    const [px, py] = app.camera.toScreen(x, y),
      color = theme.robotCss(robot),
      from = app.store.poses.drawn(robot);
    ctx.strokeStyle = ctx.fillStyle = color;
    if (from) {
      ctx.lineWidth = 1.25;
      ctx.setLineDash([3, 5]);
      ctx.beginPath();
      ctx.moveTo(...app.camera.toScreen(from.x, from.y));
      ctx.lineTo(px, py);
      ctx.stroke();
      ctx.setLineDash([]);
    }
    if (!isOnScreen(app, px, py)) continue;
    paintGoal(pen, px, py, yaw, color);
    // Above the mark, or below it if it points up. What a tool says stands below the pointer.
    const beside = BESIDE + HALF * theme.textSize,
      side = Math.sin(yaw + app.camera.angle) > 0.3 ? beside : -beside;
    /** @type {[number, number][]} */
    const places = [1, -1, 2.6, -2.6].map((times) => [px, py + times * side]);
    if (goals.length <= MOST_TEXTS || selection.has(robot)) labelWhereFree(pen, progressText(goal), places, { color });
  }
}

/**
 * @param {import("./paint.js").Pen} pen
 * @param {number} px
 * @param {number} py
 * @param {number} yaw
 * @param {string} color
 */
export function paintGoal({ app, ctx, theme }, px, py, yaw, color) {
  ctx.lineWidth = 5;
  ctx.strokeStyle = theme.css.halo;
  ctx.beginPath();
  ctx.arc(px, py, 7, 0, 2 * Math.PI);
  ctx.stroke();
  ctx.lineWidth = 2.5;
  ctx.strokeStyle = ctx.fillStyle = color;
  ctx.stroke();
  arrow(ctx, ...ahead(app, px, py, yaw, 7), ...ahead(app, px, py, yaw, 26));
}
