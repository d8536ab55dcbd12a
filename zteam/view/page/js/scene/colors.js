/** The theme's colours, as the canvases need them. */

import { rgbOf, robotColor } from "../robot_colors.js";

/** @typedef {import("../robot_colors.js").Rgb} Rgb */

/** @param {Rgb} color @param {number} [alpha] @returns {number} bytes r, g, b, a as one little-endian u32 */
export function packed([r, g, b], alpha = 1) {
  return (
    ((Math.round(255 * alpha) << 24) |
      (Math.round(255 * b) << 16) |
      (Math.round(255 * g) << 8) |
      Math.round(255 * r)) >>>
    0
  );
}

/**
 * @typedef {{dark: boolean, textSize: number, background: Rgb, grid: Rgb, text: Rgb, halo: Rgb, accent: Rgb, danger: Rgb, free: Rgb,
 *   occupied: Rgb,
 *  unknown: Rgb, css: Record<string, string>, robot: (id: number) => Rgb, robotCss: (id: number) => string}} Theme
 * textSize: the browser's size of text, 1 as most begin with
 */

const PROPERTIES = {
  background: "--scene-background",
  grid: "--scene-grid",
  text: "--scene-text",
  halo: "--scene-halo",
  accent: "--scene-accent",
  danger: "--scene-danger",
  free: "--map-free",
  occupied: "--map-occupied",
  unknown: "--map-unknown",
};

/** The theme as the page's style sheets say it now. @param {Element} element @returns {Theme} */
export function readTheme(element) {
  const style = getComputedStyle(element);
  /** @type {any} */
  const theme = { css: {} };
  for (const [name, property] of Object.entries(PROPERTIES)) {
    theme.css[name] = style.getPropertyValue(property).trim();
    theme[name] = rgbOf(theme.css[name]);
  }
  theme.textSize = parseFloat(getComputedStyle(document.documentElement).fontSize) / 16;
  theme.dark = theme.background[0] + theme.background[1] + theme.background[2] < 1.5;
  /** @type {Map<number, Rgb>} */
  const colors = new Map();
  /** @type {Map<number, string>} */
  const texts = new Map();
  theme.robot = (/** @type {number} */ id) => remember(colors, id, () => rgbOf(theme.robotCss(id)));
  theme.robotCss = (/** @type {number} */ id) => remember(texts, id, () => robotColor(id, theme.dark));
  return theme;
}

/** @template T @param {Map<number, T>} known @param {number} key @param {() => T} make @returns {T} */
function remember(known, key, make) {
  let value = known.get(key);
  if (value === undefined) known.set(key, (value = make()));
  return value;
}
