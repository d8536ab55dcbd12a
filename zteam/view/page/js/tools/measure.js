/** Measuring: the distance and direction between two places. It stays until the next one. */

import { label, strokeWithHalo } from "../scene/paint.js";

/** @param {number} dx @param {number} dy metres @returns {string} such as "3.42 m  57°" */
export function measureText(dx, dy) {
  const length = Math.hypot(dx, dy),
    degrees = Math.round((Math.atan2(dy, dx) * 180) / Math.PI);
  return `${length < 10 ? length.toFixed(3) : length.toFixed(2)} m  ${degrees}°`;
}

/** @param {import("../app.js").App} app */
export function makeMeasureTool(app) {
  /** @type {[number, number][]} two places in map */
  let ends = [];
  let held = false;
  return {
    /** @param {import("./pose.js").Point} point */
    down({ x, y }) {
      ends = [
        [x, y],
        [x, y],
      ];
      held = true;
    },
    /** @param {import("./pose.js").Point} point */
    move({ x, y }) {
      if (held) ends[1] = [x, y];
    },
    up() {
      held = false;
    },
    cancel() {
      ends = [];
      held = false;
    },
    /** @param {import("../scene/paint.js").Pen} pen */
    paint(pen) {
      if (!ends.length) return;
      const { ctx, theme } = pen,
        [[ax, ay], [bx, by]] = ends;
      const [px, py] = app.camera.toScreen(ax, ay),
        [qx, qy] = app.camera.toScreen(bx, by);
      ctx.beginPath();
      ctx.moveTo(px, py);
      ctx.lineTo(qx, qy);
      for (const [x, y] of [
        [px, py],
        [qx, qy],
      ]) {
        ctx.moveTo(x + 4, y);
        ctx.arc(x, y, 4, 0, 2 * Math.PI);
      }
      strokeWithHalo(pen, theme.css.accent, 2);
      label(pen, measureText(bx - ax, by - ay), (px + qx) / 2, (py + qy) / 2 - 14 * theme.textSize, { bold: true });
    },
  };
}
