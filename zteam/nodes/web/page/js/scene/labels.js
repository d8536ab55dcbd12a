/** Names of robots, and a ring around each one that is driven from a page. */

import { MIN_RADIUS } from "./bodies.js";
import { drawSprite, isFree, isOnScreen, spriteOf } from "./paint.js";

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
    all = app.layers.has("labels") && countInView(app) <= MAX_LABELS,
    seen = all ? [...app.store.poses.index.keys()] : importantRobots(app);
  // The selected ones choose their places first.
  const robots = seen.map((id) => lookAt(pen, id)).filter((robot) => isOnScreen(app, robot.px, robot.py));
  robots.sort((a, b) => Number(b.selected) - Number(a.selected) || a.id - b.id);
  for (const robot of robots) {
    if (robot.driver !== null) ring(pen, robot);
    const sprite = spriteOf(pen, textOf(pen, robot), { bold: robot.selected }),
      { width } = sprite;
    const place = freePlace(pen, robot, width) ?? (robot.selected ? [robot.px, robot.py + robot.radius + 11] : null);
    if (!place) continue;
    pen.taken.push(boxAt(place[0], place[1], width));
    drawSprite(pen, sprite, place[0], place[1]);
  }
}

/** How many robots there are in the part of the map that is shown. @param {import("../app.js").App} app */
function countInView({ store: { poses }, camera }) {
  const [xmin, ymin, xmax, ymax] = camera.viewport();
  let count = 0;
  for (let i = 0; i < poses.count; i++) {
    const x = poses.x[i],
      y = poses.y[i];
    if (x >= xmin && x <= xmax && y >= ymin && y <= ymax) count++;
  }
  return count;
}

/** Selected robots, and those that are driven from a page. @param {import("../app.js").App} app @returns {number[]} */
function importantRobots({ store }) {
  const ids = new Set(store.selection);
  for (const robot of store.robots.values()) if (robot.lease !== null) ids.add(robot.id);
  return [...ids].filter((id) => store.poses.index.has(id));
}

/** @param {import("./paint.js").Pen} pen @param {number} id of a robot that has a pose @returns {Seen} */
function lookAt({ app: { store, camera }, radius }, id) {
  const i = /** @type {number} */ (store.poses.index.get(id)),
    [px, py] = camera.toScreen(store.poses.x[i], store.poses.y[i]);
  const driver = store.robots.get(id)?.lease ?? null;
  return {
    id,
    px,
    py,
    radius: Math.max(MIN_RADIUS, radius(id) * camera.scale),
    selected: store.selection.has(id),
    driver,
  };
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
