/** What it costs a robot to stand at a place: of the map, and of the robot's costmap where there is one. */

import { isMap } from "./scene/grids.js";

/** A robot's middle in a cell of this cost or more touches something, as in Nav2's costmaps; 100 is in it. */
const INSCRIBED = 99;
/** A cell with at least this probability of being occupied is an obstacle. */
const OCCUPIED = 65;

/** @typedef {import("./store.js").GridTile} GridTile */
/** @typedef {{cost: number, text: string, bad: boolean}} Judgement cost: 0 to 100, -1 where it is not known */

/**
 * Whether these robots can stand at a place (m, in map); the worst for any of them.
 * @param {import("./store.js").Store} store
 * @param {number[]} robots
 * @param {number} x
 * @param {number} y
 * @returns {Judgement | null} null without a map
 */
export function judge(store, robots, x, y) {
  const maps = [...store.grids].filter(([key, tiles]) => isMap(key) && tiles.size > 0).map(([, tiles]) => tiles);
  if (!maps.length) return null;
  const reach = Math.max(0, ...robots.map((id) => inscribedRadius(store.robots.get(id)?.outline ?? [])));
  const found = lookAt(maps[0], x, y, reach);
  if (found.cost === null) return { cost: -1, text: "outside the map", bad: true };
  if (found.cost >= OCCUPIED) return { cost: 100, text: "in an obstacle (map)", bad: true };
  if (found.gap < reach) return { cost: INSCRIBED, text: `too near an obstacle (map): ${found.gap.toFixed(2)} m, needs ${reach.toFixed(2)} m`, bad: true };
  const costs = robots.map((id) => lookAt(store.grids.get(`robot_${id}/global_costmap/costmap`), x, y, 0).cost ?? -1);
  const cost = Math.max(-1, ...costs),
    of = robots.length > 1 ? ` of robot_${robots[costs.indexOf(cost)]}` : "";
  if (cost > INSCRIBED) return { cost, text: `in an obstacle (costmap${of})`, bad: true };
  if (cost === INSCRIBED) return { cost, text: `too near an obstacle (costmap${of})`, bad: true };
  if (cost > 0) return { cost, text: `cost ${cost}`, bad: false };
  return found.cost < 0 && cost < 0 ? { cost: -1, text: "unknown", bad: false } : { cost: 0, text: "free", bad: false };
}

/**
 * The cell at a place of a grid, and how far the nearest obstacle is within `reach` (m).
 * @param {Map<string, GridTile> | undefined} tiles
 * @param {number} x
 * @param {number} y
 * @param {number} reach
 * @returns {{cost: number | null, gap: number}} null outside; -1: not known
 */
function lookAt(tiles, x, y, reach) {
  /** @type {number | null} */
  let cost = null;
  let gap = Infinity;
  for (const { meta, cells } of tiles?.values() ?? []) {
    const [left, low, width, height] = meta.tile,
      r = meta.resolution,
      dx = x - meta.x,
      dy = y - meta.y;
    // In cells of this tile.
    const u = (Math.cos(meta.yaw) * dx + Math.sin(meta.yaw) * dy) / r - left,
      v = (Math.cos(meta.yaw) * dy - Math.sin(meta.yaw) * dx) / r - low;
    // A tile of the grid that has not come is not known.
    if (u + left >= 0 && v + low >= 0 && u + left < meta.width && v + low < meta.height) cost ??= -1;
    if (u >= 0 && v >= 0 && u < width && v < height) cost = cells[Math.floor(v) * width + Math.floor(u)];
    for (let row = Math.max(0, Math.floor(v - reach / r)); row <= Math.min(height - 1, v + reach / r); row++) {
      for (let column = Math.max(0, Math.floor(u - reach / r)); column <= Math.min(width - 1, u + reach / r); column++) {
        if (cells[row * width + column] < OCCUPIED) continue;
        gap = Math.min(gap, r * Math.hypot(Math.max(column - u, u - column - 1, 0), Math.max(row - v, v - row - 1, 0)));
      }
    }
  }
  return { cost, gap };
}

/**
 * The circle about the robot's origin that lies in its outline however it is turned; 0 if the origin lies outside.
 * @param {[number, number][][]} outline polygons, m
 */
function inscribedRadius(outline) {
  return Math.max(0, ...outline.map(insideOf));
}

/** @param {[number, number][]} polygon @returns {number} from the origin to its edge; 0 if it is outside */
function insideOf(polygon) {
  let inside = false,
    gap = Infinity;
  polygon.forEach(([ax, ay], i) => {
    const [bx, by] = polygon[(i + 1) % polygon.length],
      length2 = (bx - ax) ** 2 + (by - ay) ** 2;
    if (ay > 0 !== by > 0 && ax + ((0 - ay) / (by - ay)) * (bx - ax) > 0) inside = !inside;
    const share = length2 > 0 ? Math.min(1, Math.max(0, -(ax * (bx - ax) + ay * (by - ay)) / length2)) : 0;
    gap = Math.min(gap, Math.hypot(ax + share * (bx - ax), ay + share * (by - ay)));
  });
  return inside ? gap : 0;
}
