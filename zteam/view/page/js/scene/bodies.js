/** Robots with their outlines, and the things that they push. */

import { mix, rgbOf } from "../robot_colors.js";
import { packed } from "./colors.js";
import { circle } from "./polygons.js";
import { makeShapes } from "./shapes.js";

/** Robots are never drawn smaller than this radius, in CSS pixels. */
export const MIN_RADIUS = 5;

/** @typedef {import("../store.js").Store} Store */
/** @typedef {import("./colors.js").Theme} Theme */

/** The packed colours of a robot. @param {Theme} theme @param {number} id */
function lookOf(theme, id) {
  const color = theme.robot(id);
  return {
    fill: packed(color, 0.8),
    edge: packed(mix(color, theme.text, 0.55)),
    hollowFill: packed(color, 0.15),
    hollowEdge: packed(color),
    selected: packed(theme.text),
  };
}

/** @param {WebGL2RenderingContext} gl */
export function makeBodies(gl) {
  const shapes = makeShapes(gl, true),
    unknown = shapes.meshFor([circle(0.2)]);
  /** @type {Map<number, import("./shapes.js").Mesh>} by robot */
  let meshOf = new Map();
  /** @type {Map<number, ReturnType<typeof lookOf>>} by robot, in `ofTheme` */
  const looks = new Map();
  /** @type {Theme | null} */
  let ofTheme = null;

  return {
    /** @param {number} id @returns {number} metres */
    radius: (id) => (meshOf.get(id) ?? unknown).radius,

    /** @param {number} id @param {number} scale pixels a metre @returns {number} pixels to its edge, as it is drawn */
    reach(id, scale) {
      const { radius, reach } = meshOf.get(id) ?? unknown;
      return reach * Math.max(scale, MIN_RADIUS / radius);
    },

    /** The team has changed. @param {Store} store */
    setTeam(store) {
      meshOf = new Map(
        [...store.robots.values()].map((robot) => [
          robot.id,
          robot.outline.length ? shapes.meshFor(robot.outline) : unknown,
        ]),
      );
    },

    /** Take over poses and colours. @param {Store} store @param {Theme} theme */
    update({ poses, selection, robots }, theme) {
      if (theme !== ofTheme) looks.clear();
      ofTheme = theme;
      shapes.clear();
      for (let i = 0; i < poses.count; i++) {
        const id = poses.ids[i],
          selected = selection.has(id);
        let look = looks.get(id);
        if (!look) looks.set(id, (look = lookOf(theme, id)));
        const hollow = poses.truth[i] === 1,
          edge = selected ? look.selected : hollow ? look.hollowEdge : look.edge;
        const fill = hollow ? look.hollowFill : look.fill;
        const mesh = meshOf.get(id) ?? unknown,
          { x, y, yaw, dx, dy, dyaw } = poses;
        shapes.add(mesh, x[i], y[i], yaw[i], fill, edge, selected, dx[i], dy[i], dyaw[i]);
      }
      // A ghost: where a robot is that takes itself to be elsewhere.
      for (const { id, truth } of robots.values()) {
        const look = looks.get(id);
        if (truth && look) shapes.add(meshOf.get(id) ?? unknown, ...truth, look.hollowFill, look.hollowEdge, false);
      }
    },

    /**
     * @param {Float32Array} camera
     * @param {number} scale CSS pixels a metre
     * @param {number} ratio device pixels a CSS pixel
     * @param {number} left share of the robots' ways that is left
     */
    draw: (camera, scale, ratio, left) => shapes.draw(camera, scale, ratio, MIN_RADIUS, left),
  };
}

/** @param {WebGL2RenderingContext} gl */
export function makeObstacles(gl) {
  const shapes = makeShapes(gl, false);
  return {
    /** @param {Store} store @param {Theme} theme */
    update(store, theme) {
      const color = rgbOf(theme.dark ? "#c9b48f" : "#8a6a3b"),
        fill = packed(color, 0.45),
        edge = packed(color);
      shapes.clear();
      // The others are in the map.
      const movable = (store.docs.obstacles ?? []).filter((/** @type {any} */ obstacle) => obstacle.movable);
      for (const { x, y, yaw, outline } of movable) shapes.add(shapes.meshFor(outline), x, y, yaw, fill, edge, false);
    },
    /**
     * @param {Float32Array} camera
     * @param {number} scale CSS pixels a metre
     * @param {number} ratio device pixels a CSS pixel
     */
    draw: (camera, scale, ratio) => shapes.draw(camera, scale, ratio, 0),
  };
}
