/** What is made of straight lines: the grid of the map, trails, links to leaders, plans, particles. */

import { ownerOf } from "../layers.js";
import { MIN_RADIUS } from "./bodies.js";
import { packed } from "./colors.js";
import { makeSegments } from "./segments.js";

/** Seconds of the team's clock until a trail has faded. */
const TRAIL = 60;
const TRAIL_STEP = 0.05;
/** A robot that is this far from its last place was put there. */
const JUMP = 1.0;
const TRAIL_LINES = 65536;

/** @typedef {import("../store.js").Store} Store */
/** @typedef {import("./colors.js").Theme} Theme */

/** @param {WebGL2RenderingContext} gl */
export function makeTrails(gl) {
  const lines = makeSegments(gl, TRAIL_LINES, true);
  /** @type {Map<number, [number, number]>} */
  const last = new Map();
  let stamp = 0;
  return {
    clear() {
      lines.clear();
      last.clear();
    },
    /** @param {Store} store @param {Theme} theme */
    update(store, theme) {
      const { poses, frame } = store;
      if (frame.stamp < stamp || !poses.count) this.clear();
      stamp = frame.stamp;
      for (let i = 0; i < poses.count; i++) {
        const id = poses.ids[i],
          x = poses.x[i] - poses.left * poses.dx[i],
          y = poses.y[i] - poses.left * poses.dy[i],
          from = last.get(id);
        if (!from) last.set(id, [x, y]);
        else {
          const step = Math.abs(x - from[0]) + Math.abs(y - from[1]);
          if (step < TRAIL_STEP) continue;
          if (step < JUMP) lines.add(from[0], from[1], x, y, packed(theme.robot(id), 0.65), stamp);
          from[0] = x;
          from[1] = y;
        }
      }
    },
    /** @param {Float32Array} camera @param {number} ratio */
    draw: (camera, ratio) => lines.draw(camera, 2 * ratio, stamp, TRAIL),
  };
}

/** Arrows from followers to their leaders, from edge to edge. @param {WebGL2RenderingContext} gl */
export function makeLinks(gl) {
  const lines = makeSegments(gl, 64, false);
  return {
    /** @param {Float32Array} camera
     * @param {number} ratio
     * @param {Store} store
     * @param {Theme} theme
     * @param {number} scale pixels a metre
     * @param {(id: number) => number} radius metres */
    draw(camera, ratio, store, theme, scale, radius) {
      lines.clear();
      const { poses } = store,
        tip = 8 / scale;
      for (const robot of store.robots.values()) {
        if (robot.leader < 0) continue;
        const a = poses.drawn(robot.id),
          b = poses.drawn(robot.leader);
        if (!a || !b) continue;
        const dx = b.x - a.x,
          dy = b.y - a.y,
          length = Math.hypot(dx, dy) || 1;
        const ux = dx / length,
          uy = dy / length;
        const start = Math.max(MIN_RADIUS / scale, radius(robot.id)),
          end = length - Math.max(MIN_RADIUS / scale, radius(robot.leader)) - 2 / scale;
        if (end - start < tip) continue;
        const color = packed(theme.robot(robot.id), 0.9),
          tipX = a.x + ux * end,
          tipY = a.y + uy * end;
        lines.add(a.x + ux * start, a.y + uy * start, tipX, tipY, color);
        for (const side of [-0.5, 0.5]) {
          lines.add(tipX, tipY, tipX - tip * (ux - side * uy), tipY - tip * (uy + side * ux), color);
        }
      }
      lines.draw(camera, 1.5 * ratio);
    },
  };
}

/** @param {WebGL2RenderingContext} gl */
export function makePlans(gl) {
  const lines = makeSegments(gl, 256, false);
  return {
    /** @param {Store} store @param {Theme} theme @param {(robot: number) => boolean} shows whether a robot's are drawn */
    update(store, theme, shows) {
      lines.clear();
      for (const [key, points] of store.paths) {
        if (!shows(ownerOf(key))) continue;
        const color = packed(theme.robot(Math.max(0, ownerOf(key))), 0.9);
        for (let i = 2; i + 1 < points.length; i += 2) {
          lines.add(points[i - 2], points[i - 1], points[i], points[i + 1], color);
        }
      }
    },
    /** @param {Float32Array} camera @param {number} ratio */
    draw: (camera, ratio) => lines.draw(camera, 2.5 * ratio),
  };
}

/** Poses as short lines in their direction. @param {WebGL2RenderingContext} gl */
export function makeParticles(gl) {
  const lines = makeSegments(gl, 1024, false),
    length = 0.15;
  return {
    /** @param {Store} store @param {Theme} theme @param {(robot: number) => boolean} shows whether a robot's are drawn */
    update(store, theme, shows) {
      lines.clear();
      for (const [key, poses] of store.posearrays) {
        if (!shows(ownerOf(key))) continue;
        const color = packed(theme.robot(Math.max(0, ownerOf(key))));
        for (let i = 0; i + 2 < poses.length; i += 3) {
          const x = poses[i],
            y = poses[i + 1],
            yaw = poses[i + 2];
          lines.add(x, y, x + length * Math.cos(yaw), y + length * Math.sin(yaw), color);
        }
      }
    },
    /** @param {Float32Array} camera @param {number} ratio */
    draw: (camera, ratio) => lines.draw(camera, 1.25 * ratio),
  };
}

/** The grid outside of the map, whose cells have their own. @param {WebGL2RenderingContext} gl */
export function makeMapGrid(gl) {
  const lines = makeSegments(gl, 128, false);
  /** What the lines were made for. */
  let ofCamera = /** @type {Float32Array | null} */ (null),
    ofTheme = /** @type {Theme | null} */ (null);
  return {
    /**
     * @param {Float32Array} camera
     * @param {number} ratio
     * @param {import("./camera.js").Camera} view
     * @param {Theme} theme
     */
    draw(camera, ratio, view, theme) {
      if (camera === ofCamera && theme === ofTheme) return lines.draw(camera, ratio);
      [ofCamera, ofTheme] = [camera, theme];
      lines.clear();
      const step = gridStep(view.scale),
        [xmin, ymin, xmax, ymax] = view.viewport(),
        color = packed(theme.grid);
      for (let x = Math.ceil(xmin / step) * step; x <= xmax; x += step) lines.add(x, ymin, x, ymax, color);
      for (let y = Math.ceil(ymin / step) * step; y <= ymax; y += step) lines.add(xmin, y, xmax, y, color);
      lines.draw(camera, ratio);
    },
  };
}

/**
 * Metres between lines: 1 m, or the next of 5, 10, 50, … that is at least 20 pixels.
 * @param {number} scale pixels a metre
 */
export function gridStep(scale) {
  const least = 20 / scale,
    power = 10 ** Math.floor(Math.log10(least));
  return Math.max(1, [power, 5 * power, 10 * power].find((step) => step >= least) ?? 10 * power);
}
