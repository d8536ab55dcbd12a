/** Names of robots, and a ring around each one that is driven from a page. */

import { MIN_RADIUS } from "./bodies.js";
import { isFree, isOnScreen, label, labelWidth } from "./paint.js";

/** With more robots on the screen only selected and driven ones are named. */
const MAX_LABELS = 150;
/** A robot of this radius in pixels has its whole name, a smaller one its id. */
const NAME_RADIUS = 9;
const HEIGHT = 14;

/**
 * @typedef {{id: number, px: number, py: number, radius: number, selected: boolean, driver: number | null}} Seen
 *   pixels
 */

/** @param {import("./paint.js").Pen} pen */
export function paintLabels(pen) {
  const { app } = pen,
    seen = seenRobots(pen),
    all = app.layers.has("labels") && seen.length <= MAX_LABELS;
  // The important ones choose first.
  seen.sort((a, b) => Number(b.selected) - Number(a.selected) || a.id - b.id);
  for (const robot of seen) {
    if (robot.driver !== null) ring(pen, robot);
    if (!all && !robot.selected && robot.driver === null) continue;
    const text = textOf(pen, robot),
      look = { bold: robot.selected },
      width = labelWidth(pen, text, look);
    const place = freePlace(pen, robot, width) ?? (robot.selected ? [robot.px, robot.py + robot.radius + 11] : null);
    if (!place) continue;
    pen.taken.push(boxAt(place[0], place[1], width));
    label(pen, text, place[0], place[1], look);
  }
}

/** @param {import("./paint.js").Pen} pen @returns {Seen[]} the robots on the screen */
function seenRobots({ app, radius }) {
  const { store, camera } = app,
    { poses } = store,
    seen = [];
  for (let i = 0; i < poses.count; i++) {
    const [px, py] = camera.toScreen(poses.x[i], poses.y[i]),
      id = poses.ids[i];
    if (!isOnScreen(app, px, py)) continue;
    const selected = store.selection.has(id),
      driver = store.robots.get(id)?.lease ?? null;
    seen.push({ id, px, py, radius: Math.max(MIN_RADIUS, radius(id) * camera.scale), selected, driver });
  }
  return seen;
}

/** @param {import("./paint.js").Pen} pen @param {Seen} robot */
function textOf({ app: { store } }, { id, radius, selected, driver }) {
  const name = radius >= NAME_RADIUS || selected ? (store.robots.get(id)?.name ?? `robot ${id}`) : String(id);
  if (driver === null) return name;
  return `${name} · driven by ${driver === store.connection.viewer ? "this page" : `viewer ${driver}`}`;
}

/**
 * Below the robot, or above, right or left of it; null if other labels are everywhere.
 * @param {import("./paint.js").Pen} pen
 * @param {Seen} robot
 * @param {number} width
 * @returns {[number, number] | null} middle
 */
function freePlace(pen, { px, py, radius }, width) {
  const beside = radius + width / 2 + 1;
  /** @type {[number, number][]} */
  const places = [
    [px, py + radius + 11],
    [px, py - radius - 11],
    [px + beside, py],
    [px - beside, py],
  ];
  return places.find(([x, y]) => isFree(pen, boxAt(x, y, width))) ?? null;
}

/** @param {number} x @param {number} y @param {number} width @returns {import("./paint.js").Box} */
function boxAt(x, y, width) {
  return [x - width / 2 + 2, y - HEIGHT / 2, x + width / 2 - 2, y + HEIGHT / 2];
}

/** @param {import("./paint.js").Pen} pen @param {Seen} robot */
function ring({ ctx, theme }, { px, py, radius }) {
  ctx.strokeStyle = theme.css.danger;
  ctx.lineWidth = 2;
  ctx.beginPath();
  ctx.arc(px, py, radius + 6, 0, 2 * Math.PI);
  ctx.stroke();
}
