/** Goals of robots: a ring with a heading in the robot's colour, and a dashed line from the robot. */

import { ahead, arrow, isOnScreen } from "./paint.js";

/** @param {import("./paint.js").Pen} pen */
export function paintGoals(pen) {
  const { app, ctx, theme } = pen;
  for (const { robot, x, y, yaw } of app.store.docs.goals ?? []) {
    const [px, py] = app.camera.toScreen(x, y),
      color = theme.robotCss(robot),
      from = app.store.poses.at(robot);
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
    if (isOnScreen(app, px, py)) paintGoal(pen, px, py, yaw, color);
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
