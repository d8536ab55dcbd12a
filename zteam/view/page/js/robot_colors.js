/** The colour of each robot, the same in the map and in the panels. */

// Okabe and Ito, Color Universal Design (2008): told apart with every common colour blindness. Their yellow and sky
// blue
// are darkened on light ground, their blue and green lightened on dark ground, until each stands out from its ground.
const ON_LIGHT = ["#0072b2", "#d55e00", "#009e73", "#c0569a", "#c98600", "#2a9fd6", "#8c7a00", "#5d5d5d"];
const ON_DARK = ["#3d9fe0", "#ff7f2a", "#1fc796", "#e08fc0", "#ffb733", "#7cc8f2", "#f0e442", "#b0b0b0"];
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
