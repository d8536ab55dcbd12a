/** Where names of robots go, and a ring around each robot that is driven from a page. */

import { MIN_RADIUS } from "./bodies.js";
import { Occupancy } from "./occupancy.js";
import { drawSprite, isOnScreen, spriteOf, strokeWithHalo } from "./paint.js";

/** @typedef {import("./names.js").Name} Name */

/** With more robots on the screen only selected and driven ones are named. */
const MAX_LABELS = 150;
/** A robot of this radius in pixels has its whole name, a smaller one its id. */
const NAME_RADIUS = 9;
/** Where a name may be, as directions on the screen: first where it touches its robot. */
const TOUCHING = [
  [0, 1],
  [0, -1],
  [1, 0],
  [-1, 0],
];
/** Then with a line to it, at these pixels from its edge, all round. */
const AWAY = [14, 30, 50, 75],
  AROUND = Array.from({ length: 12 }, (_, i) => [Math.cos((i * Math.PI) / 6), Math.sin((i * Math.PI) / 6)]);
const PLACES = TOUCHING.length + AWAY.length * AROUND.length;
/** States of a robot that does not live, though it stands there as before. */
const LACKING = new Set(["lost", "stopped", "silent", "fault"]);
/** A robot's middle, where no name of others may be, as a share of its size. */
const MIDDLE = 0.8;
const BOLD = { bold: true },
  PLAIN = { bold: false };

/**
 * @typedef {{id: number, px: number, py: number, dx: number, dy: number, radius: number, reach: number, selected: boolean,
 *   driver: number | null}} Seen pixels: its newest pose, the way to it, and how far its edge is at most and in the mean
 */

const occupied = new Occupancy();
/** Where each robot has its name: it stays there as long as it can. @type {Map<number, number>} */
const places = new Map();

/** The names that are shown. Their places are taken from now on. @param {import("./paint.js").Pen} pen */
export function placeNames(pen) {
  const { app } = pen,
    { selection, poses } = app.store,
    /** @type {Name[]} */
    names = [],
    all = app.layers.has("labels") && countInView(app) <= MAX_LABELS;
  occupied.begin(app.camera.width, app.camera.height);
  if (all) {
    for (let i = 0; i < poses.count; i++) {
      const [px, py] = app.camera.toScreen(poses.x[i], poses.y[i]),
        half = MIDDLE * pen.reach(poses.ids[i]);
      if (isOnScreen(app, px, py)) occupied.take([px - half, py - half, px + half, py + half]);
    }
  }
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
  const place = choosePlace(robot, sprite);
  if (place < 0) return;
  const box = boxAt(robot, sprite, place),
    [left, top, right, bottom] = box;
  places.set(id, place);
  pen.taken.push(box);
  occupied.take(box);
  names.push({
    sprite,
    px: (left + right) / 2,
    py: (top + bottom) / 2,
    dx: robot.dx,
    dy: robot.dy,
    leader: place < TOUCHING.length ? null : leaderOf(robot, box),
    robot: id,
  });
}

/** Lines from names to their robots that they do not touch. @param {import("./paint.js").Pen} pen */
export function paintLeaders(pen) {
  const { app, ctx, theme, names } = pen,
    { left } = app.store.poses;
  for (const { leader, dx, dy, robot } of names) {
    if (!leader) continue;
    ctx.beginPath();
    ctx.moveTo(leader[0] - left * dx, leader[1] - left * dy);
    ctx.lineTo(leader[2] - left * dx, leader[3] - left * dy);
    strokeWithHalo(pen, theme.robotCss(robot), 1.5);
  }
}

/** Names on the 2-D canvas, where there is no WebGL2. @param {import("./paint.js").Pen} pen @param {Name[]} names */
export function paintNames(pen, names) {
  const { left } = pen.app.store.poses;
  for (const { sprite, px, py, dx, dy } of names) drawSprite(pen, sprite, px - left * dx, py - left * dy);
}

/** @param {import("./paint.js").Pen} pen */
export function paintRings(pen) {
  for (const id of drivenRobots(pen.app)) {
    const robot = lookAt(pen, id),
      { left } = pen.app.store.poses;
    robot.px -= left * robot.dx;
    robot.py -= left * robot.dy;
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
function lookAt({ app: { store, camera }, radius, reach }, id) {
  const i = /** @type {number} */ (store.poses.index.get(id)),
    { x, y, dx, dy } = store.poses,
    [px, py] = camera.toScreen(x[i], y[i]),
    [fromX, fromY] = camera.toScreen(x[i] - dx[i], y[i] - dy[i]);
  const driver = store.robots.get(id)?.lease ?? null;
  return {
    id,
    px,
    py,
    dx: px - fromX,
    dy: py - fromY,
    radius: Math.max(MIN_RADIUS, radius(id) * camera.scale),
    reach: reach(id),
    selected: store.selection.has(id),
    driver,
  };
}

/** @param {import("./paint.js").Pen} pen @param {Seen} robot */
function textOf({ app: { store } }, { id, radius, selected, driver }) {
  const robot = store.robots.get(id),
    short = radius >= NAME_RADIUS || selected ? (robot?.name ?? `robot ${id}`) : String(id),
    name = robot && LACKING.has(robot.state) ? `${short} · ${robot.state}` : short;
  if (driver === null) return name;
  return `${name} · driven by ${driver === store.connection.viewer ? "this page" : `viewer ${driver}`}`;
}

/**
 * The place of a name, touching its robot, or where it is crowded with a line to it; -1 if there is none, but a selected
 * robot has its own.
 * @param {Seen} robot
 * @param {import("./paint.js").Sprite} sprite
 */
function choosePlace(robot, sprite) {
  const last = places.get(robot.id) ?? 0;
  if (last < TOUCHING.length && occupied.isFree(boxAt(robot, sprite, last))) return last;
  for (let place = 0; place < PLACES; place++) {
    if (place === TOUCHING.length && last > place && isPlace(robot, sprite, last)) return last;
    if (isPlace(robot, sprite, place)) return place;
  }
  return robot.selected ? 0 : -1;
}

/** @param {Seen} robot @param {import("./paint.js").Sprite} sprite @param {number} place */
function isPlace(robot, sprite, place) {
  const box = boxAt(robot, sprite, place);
  return occupied.isFree(box) && (place < TOUCHING.length || occupied.holds(box));
}

/** @param {Seen} robot @param {import("./paint.js").Sprite} sprite of the name, which has a margin @param {number} place
 * @returns {import("./paint.js").Box} */
function boxAt({ px, py, reach }, { width, height }, place) {
  const away = place - TOUCHING.length,
    [ux, uy] = away < 0 ? TOUCHING[place] : AROUND[away % AROUND.length],
    distance = away < 0 ? reach : reach + AWAY[Math.floor(away / AROUND.length)];
  const half = width / 2 - 2,
    tall = height / 2 - 2,
    x = px + ux * (distance + half),
    y = py + uy * (distance + tall);
  return [x - half, y - tall, x + half, y + tall];
}

/** From the robot's edge to the nearest point of its name. @param {Seen} robot @param {import("./paint.js").Box} box */
function leaderOf({ px, py, reach }, [left, top, right, bottom]) {
  const x = Math.min(Math.max(px, left), right),
    y = Math.min(Math.max(py, top), bottom),
    share = reach / Math.max(Math.hypot(x - px, y - py), 1);
  return [px + share * (x - px), py + share * (y - py), x, y];
}

/** @param {import("./paint.js").Pen} pen @param {Seen} robot */
function ring({ ctx, theme }, { px, py, radius }) {
  ctx.strokeStyle = theme.css.danger;
  ctx.lineWidth = 2;
  ctx.beginPath();
  ctx.arc(px, py, radius + 6, 0, 2 * Math.PI);
  ctx.stroke();
}
