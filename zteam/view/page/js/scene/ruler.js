/** The bar that tells the scale, at the lower left. */

import { label, strokeWithHalo } from "./paint.js";

const LONGEST = 130;

/**
 * The longest of 1, 2 and 5 times a power of ten metres that is at most `LONGEST` pixels.
 * @param {number} scale pixels a metre
 */
export function barLength(scale) {
  const most = LONGEST / scale,
    power = 10 ** Math.floor(Math.log10(most));
  return [5, 2, 1].map((factor) => factor * power).find((length) => length <= most) ?? power;
}

/** @param {import("./paint.js").Pen} pen */
export function paintRuler(pen) {
  const { ctx, app, theme } = pen,
    { camera } = app;
  const length = barLength(camera.scale),
    width = length * camera.scale,
    left = 16,
    y = camera.height - 16;
  ctx.beginPath();
  ctx.moveTo(left, y - 5);
  ctx.lineTo(left, y);
  ctx.lineTo(left + width, y);
  ctx.lineTo(left + width, y - 5);
  strokeWithHalo(pen, theme.css.text, 1.5);
  label(pen, length >= 1 ? `${length} m` : `${Math.round(1000 * length) / 10} cm`, left + width / 2, y - 3 - 8 * theme.textSize);
}
