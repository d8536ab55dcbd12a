/** What other sensors see: sonars as cones, fiducials as diamonds with their number. */

import { MIN_RADIUS } from "./bodies.js";
import { inMetres, inPixels, isOnScreen, label, trace } from "./paint.js";

/** @param {import("./paint.js").Pen} pen */
export function paintDevices(pen) {
  if (pen.app.layers.has("sonars")) paintSonars(pen);
  if (pen.app.layers.has("fiducials")) paintFiducials(pen);
}

/** @param {import("./paint.js").Pen} pen */
function paintSonars(pen) {
  const { ctx, app, theme } = pen;
  for (const { robot, x, y, yaw, field_of_view: width, range, max_range: most } of app.store.docs.sonars ?? []) {
    if (!app.layers.showsRobot("sensors", robot)) continue;
    const hit = range !== null && range >= 0 && range < most;
    inMetres(pen, x, y, yaw);
    ctx.beginPath();
    ctx.moveTo(0, 0);
    ctx.arc(0, 0, hit ? range : most, -width / 2, width / 2);
    ctx.closePath();
    ctx.fillStyle = ctx.strokeStyle = theme.robotCss(robot);
    ctx.globalAlpha = hit ? 0.22 : 0.07;
    ctx.fill();
    if (!hit) continue;
    ctx.globalAlpha = 0.9;
    ctx.lineWidth = 2 / app.camera.scale;
    ctx.beginPath();
    ctx.arc(0, 0, range, -width / 2, width / 2);
    ctx.stroke();
  }
  ctx.globalAlpha = 1;
  inPixels(pen);
}

/** @param {import("./paint.js").Pen} pen */
function paintFiducials(pen) {
  const { ctx, app, theme } = pen;
  for (const { robot, id, x, y } of app.store.docs.fiducials ?? []) {
    if (!app.layers.showsRobot("sensors", robot)) continue;
    const [px, py] = app.camera.toScreen(x, y);
    if (!isOnScreen(app, px, py)) continue;
    const from = app.store.poses.drawn(robot);
    ctx.strokeStyle = theme.robotCss(robot);
    ctx.lineWidth = 1;
    ctx.setLineDash([2, 3]);
    if (from) {
      trace(ctx, [app.camera.toScreen(from.x, from.y), [px, py]], false);
      ctx.stroke();
    }
    ctx.setLineDash([]);
    ctx.lineWidth = 2;
    trace(
      ctx,
      [
        [px - MIN_RADIUS, py],
        [px, py - MIN_RADIUS],
        [px + MIN_RADIUS, py],
        [px, py + MIN_RADIUS],
      ],
      true,
    );
    ctx.stroke();
    label(pen, String(id), px, py - 14 * pen.theme.textSize, {});
  }
}
