/** Where names of robots go, and a ring around each robot that is driven from a page. */

import { MIN_RADIUS } from "./bodies.js";
import { drawSprite, isFree, isOnScreen, spriteOf } from "./paint.js";

/** @typedef {import("./names.js").Name} Name */

/** With more robots on the screen only selected and driven ones are named. */
const MAX_LABELS = 150;
/** A robot of this radius in pixels has its whole name, a smaller one its id. */
const NAME_RADIUS = 9;
const HEIGHT = 14;
const BOLD = { bold: true },
  PLAIN = { bold: false };

/**
 * @typedef {{id: number, px: number, py: number, radius: number, selected: boolean, driver: number | null}} Seen
 *   pixels
 */

/** The names that are shown. Their places are taken from now on. @param {import("./paint.js").Pen} pen */
export function placeNames(pen) {
  const { app } = pen,
    { selection, poses } = app.store,
    /** @type {Name[]} */
    names = [],
    all = app.layers.has("labels") && countInView(app) <= MAX_LABELS;
  // The selected ones choose their places first.
  for (const id of selection) if (poses.index.has(id)) placeName(pen, id, names);
  if (all) {
    for (let i = 0; i < poses.count; i++) if (!selection.has(poses.ids[i])) placeName(pen, poses.ids[i], names);
  } else {
    for (const id of drivenRobots(app)) if (!selection.has(id)) placeName(pen, id, names);
  }
  return names;
}

/** @param {import("./paint.js").Pen} pen @param {number} id of a robot that has a pose @param {Name[]} names */
function placeName(pen, id, names) {
  const robot = lookAt(pen, id);
  if (!isOnScreen(pen.app, robot.px, robot.py)) return;
  const sprite = spriteOf(pen, textOf(pen, robot), robot.selected ? BOLD : PLAIN);
  const box = freeBox(pen, robot, sprite.width);
  if (!box) return;
  pen.taken.push(box);
  names.push({ sprite, px: (box[0] + box[2]) / 2, py: (box[1] + box[3]) / 2 });
}

/** Names on the 2-D canvas, where there is no WebGL2. @param {import("./paint.js").Pen} pen @param {Name[]} names */
export function paintNames(pen, names) {
  for (const { sprite, px, py } of names) drawSprite(pen, sprite, px, py);
}

/** @param {import("./paint.js").Pen} pen */
export function paintRings(pen) {
  for (const id of drivenRobots(pen.app)) {
    const robot = lookAt(pen, id);
    if (isOnScreen(pen.app, robot.px, robot.py)) ring(pen, robot);
  }
}

/** Those that are driven from a page and have a pose. @param {import("../app.js").App} app @returns {number[]} */
function drivenRobots({ store }) {
  const ids = [];
  for (const { id, lease } of store.robots.values()) if (lease !== null && store.poses.index.has(id)) ids.push(id);
  return ids;
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
 * Below the robot, or above, right or left of it; null if other labels are everywhere, but a selected robot has its own.
 * @param {import("./paint.js").Pen} pen
 * @param {Seen} robot
 * @param {number} width
 * @returns {import("./paint.js").Box | null}
 */
function freeBox(pen, { px, py, radius, selected }, width) {
  const beside = radius + width / 2 + 1,
    below = boxAt(px, py + radius + 11, width);
  if (isFree(pen, below)) return below;
  const above = boxAt(px, py - radius - 11, width);
  if (isFree(pen, above)) return above;
  const right = boxAt(px + beside, py, width);
  if (isFree(pen, right)) return right;
  const left = boxAt(px - beside, py, width);
  return isFree(pen, left) ? left : selected ? below : null;
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
