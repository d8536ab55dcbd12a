/** The upper canvas: text, axes, arrows, markers, and what the tools show. */

import { paintDevices } from "./devices.js";
import { paintFrames } from "./frames.js";
import { paintGoals } from "./goals.js";
import { paintLeaders, paintRings } from "./labels.js";
import { paintMarkers } from "./markers.js";
import { inPixels } from "./paint.js";
import { paintRuler } from "./ruler.js";

/** @typedef {(pen: import("./paint.js").Pen) => void} Painter */

/** @param {import("./paint.js").Pen} pen @param {Painter[]} painters of the tools, above all others */
export function paintAbove(pen, painters) {
  const {
    ctx,
    app: { layers },
  } = pen;
  ctx.setTransform(1, 0, 0, 1, 0, 0);
  ctx.clearRect(0, 0, ctx.canvas.width, ctx.canvas.height);
  inPixels(pen);
  ctx.globalAlpha = layers.opacity("markers") / 100;
  if (layers.has("markers")) paintMarkers(pen);
  ctx.globalAlpha = 1;
  paintDevices(pen);
  if (layers.has("goals")) paintGoals(pen);
  paintLeaders(pen);
  paintRings(pen);
  if (layers.has("tf")) paintFrames(pen);
  paintRuler(pen);
  for (const paint of painters) paint(pen);
}
