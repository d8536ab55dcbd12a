/** Markers (visualization_msgs/Marker, and polygons as line strips). */

import { ownerOf } from "../layers.js";
import { inMetres, inPixels, label, trace } from "./paint.js";

/** @typedef {{ns: string, id: number, type: number, x: number, y: number, yaw: number, scale: number[], color:
 *   number[] | null,
 *  points: number[][], text: string}} Marker */

// visualization_msgs/msg/Marker.
const ARROW = 0,
  CUBE = 1,
  SPHERE = 2,
  CYLINDER = 3,
  LINE_STRIP = 4,
  LINE_LIST = 5,
  CUBE_LIST = 6,
  SPHERE_LIST = 7,
  POINTS = 8,
  TEXT = 9,
  TRIANGLES = 11;

/** @param {import("./paint.js").Pen} pen */
export function paintMarkers(pen) {
  for (const marker of pen.app.store.docs.markers ?? []) {
    const [r, g, b, a] = marker.color ?? [],
      owner = ownerOf(marker.ns);
    // A polygon has no colour: a footprint has its robot's.
    const color = marker.color ? `rgba(${255 * r}, ${255 * g}, ${255 * b}, ${a})` : owner >= 0 ? pen.theme.robotCss(owner) : pen.theme.css.accent;
    pen.ctx.fillStyle = pen.ctx.strokeStyle = color;
    inMetres(pen, marker.x, marker.y, marker.yaw);
    paintMarker(pen, marker);
  }
  inPixels(pen);
}

/** @param {import("./paint.js").Pen} pen @param {Marker} marker in its own frame, in metres */
function paintMarker(pen, marker) {
  const { ctx, app } = pen,
    [sx = 0, sy = 0] = marker.scale,
    points = /** @type {[number, number][]} */ (marker.points ?? []);
  const pixel = 1 / app.camera.scale;
  ctx.lineWidth = Math.max(sx, 1.5 * pixel);
  switch (marker.type) {
    case ARROW:
      return points.length > 1
        ? metricArrow(ctx, points[0], points[1], Math.max(sx, pixel))
        : metricArrow(ctx, [0, 0], [sx, 0], Math.max(sy, pixel));
    case CUBE:
      return ctx.fillRect(-sx / 2, -sy / 2, sx, sy);
    case SPHERE:
    case CYLINDER:
      return ellipse(ctx, 0, 0, sx, sy);
    case LINE_STRIP:
      trace(ctx, points, false);
      return ctx.stroke();
    case LINE_LIST:
      return inGroups(points, 2, (pair) => {
        trace(ctx, pair, false);
        ctx.stroke();
      });
    case TRIANGLES:
      return inGroups(points, 3, (corners) => {
        trace(ctx, corners, true);
        ctx.fill();
      });
    case CUBE_LIST:
    case POINTS:
      return points.forEach(([x, y]) => ctx.fillRect(x - sx / 2, y - sy / 2, Math.max(sx, pixel), Math.max(sy, pixel)));
    case SPHERE_LIST:
      return points.forEach(([x, y]) => ellipse(ctx, x, y, sx, sy));
    case TEXT: {
      const color = String(ctx.fillStyle);
      inPixels(pen);
      return label(pen, marker.text, ...app.camera.toScreen(marker.x, marker.y), { color });
    }
  }
}

/** @template T @param {T[]} items @param {number} size @param {(group: T[]) => void} take */
function inGroups(items, size, take) {
  for (let i = 0; i + size <= items.length; i += size) take(items.slice(i, i + size));
}

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {number} x
 * @param {number} y
 * @param {number} width
 * @param {number} height
 */
function ellipse(ctx, x, y, width, height) {
  ctx.beginPath();
  ctx.ellipse(x, y, width / 2, (height || width) / 2, 0, 0, 2 * Math.PI);
  ctx.fill();
}

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {number[]} from
 * @param {number[]} to
 * @param {number} width of the shaft
 */
function metricArrow(ctx, from, to, width) {
  const angle = Math.atan2(to[1] - from[1], to[0] - from[0]),
    length = Math.hypot(to[0] - from[0], to[1] - from[1]);
  const head = Math.min(3 * width, length);
  ctx.save();
  ctx.translate(from[0], from[1]);
  ctx.rotate(angle);
  trace(
    ctx,
    [
      [0, width / 2],
      [length - head, width / 2],
      [length - head, 1.2 * width],
      [length, 0],
      [length - head, -1.2 * width],
      [length - head, -width / 2],
      [0, -width / 2],
    ],
    true,
  );
  ctx.fill();
  ctx.restore();
}
