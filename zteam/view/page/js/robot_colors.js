/** The colour of each robot, the same in the map and in the panels. */

// Hues of Okabe and Ito (2008), moved until each two differ by a CIEDE2000 of at least 10, also as protanopia and
// deuteranopia show them (Machado 2009), and each stands out from the floor by a contrast of 3, and from walls. A test
// computes it.
const ON_LIGHT = ["#016ac2", "#ad5200", "#0a9465", "#c34e88", "#c57601", "#1690d2", "#5599aa", "#ff5577"];
const ON_DARK = ["#159ffa", "#e87220", "#10c188", "#d083b5", "#fab112", "#7dcaf4", "#ffff58", "#bb4433"];
const ROUNDS = 3;

/** @typedef {[number, number, number]} Rgb each 0..1 */

/** Whether the page is dark now. */
export function isDark() {
  return document.documentElement.dataset.theme === "dark";
}

/**
 * Eight base colours, then the same ones lighter and darker.
 * @param {number} id @param {boolean} [dark] the theme @returns {string} #rrggbb
 */
export function robotColor(id, dark = isDark()) {
  const palette = dark ? ON_DARK : ON_LIGHT,
    base = palette[id % palette.length];
  const round = Math.floor(id / palette.length) % ROUNDS;
  return round === 0 ? base : hexOf(mix(rgbOf(base), round === 1 ? [1, 1, 1] : [0, 0, 0], 0.3));
}

/** @param {string} hex such as #0072b2 or #fff @returns {Rgb} */
export function rgbOf(hex) {
  const long = hex.length === 4 ? [...hex.slice(1)].map((digit) => digit + digit).join("") : hex.slice(1);
  const value = parseInt(long, 16);
  return [((value >> 16) & 255) / 255, ((value >> 8) & 255) / 255, (value & 255) / 255];
}

/** @param {Rgb} color @returns {string} #rrggbb */
export function hexOf(color) {
  return `#${color
    .map((part) =>
      Math.round(255 * part)
        .toString(16)
        .padStart(2, "0"),
    )
    .join("")}`;
}

/** @param {Rgb} a @param {Rgb} b @param {number} share of b @returns {Rgb} */
export function mix(a, b, share) {
  return [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share, a[2] + (b[2] - a[2]) * share];
}
