/** Names of robots, and their rings: the robot that is followed by the camera, the robot that is driven from a page. */

import { MIN_RADIUS } from "./bodies.js";
import { isOnScreen, label } from "./paint.js";

/** With more robots on the screen only selected and driven ones are named. */
const MAX_LABELS = 150;
/** A robot of this radius in pixels has its whole name, a smaller one its id. */
const NAME_RADIUS = 9;

/** @param {import("./paint.js").Pen} pen */
export function paintLabels(pen) {
  const { app } = pen, { store, camera } = app, { poses } = store;
  /** @type {[number, number, number][]} */
  const seen = [];
  for (let i = 0; i < poses.count; i++) {
    const [px, py] = camera.toScreen(poses.x[i], poses.y[i]);
    if (isOnScreen(app, px, py)) seen.push([poses.ids[i], px, py]);
  }
  const all = app.layers.has("labels") && seen.length <= MAX_LABELS;
  for (const [id, px, py] of seen) {
    const robot = store.robots.get(id), selected = store.selection.has(id), driven = robot?.lease != null;
    const radius = Math.max(MIN_RADIUS, pen.radius(id) * camera.scale);
    if (driven) ring(pen, px, py, radius + 6, pen.theme.css.danger, []);
    if (!all && !selected && !driven) continue;
    const name = radius >= NAME_RADIUS || selected ? (robot?.name ?? `robot ${id}`) : String(id);
    const text = driven ? `${name} · driven by ${robot?.lease === store.connection.viewer ? "this page" : `viewer ${robot?.lease}`}` : name;
    label(pen, text, px, py + radius + 11, { bold: selected, color: pen.theme.css.text });
  }
}

/** @param {import("./paint.js").Pen} pen @param {number} px @param {number} py @param {number} radius pixels @param {string} color @param {number[]} dash */
export function ring({ ctx }, px, py, radius, color, dash) {
  ctx.strokeStyle = color;
  ctx.lineWidth = 2;
  ctx.setLineDash(dash);
  ctx.beginPath();
  ctx.arc(px, py, radius, 0, 2 * Math.PI);
  ctx.stroke();
  ctx.setLineDash([]);
}
