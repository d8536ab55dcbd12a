/** The map area: two canvases, drawn when something has changed. */

import { paintAbove } from "./above.js";
import { makeBelow } from "./below.js";
import { readTheme } from "./colors.js";
import { isMap } from "./grids.js";
import { paintNames, placeNames } from "./labels.js";

/** Figures of so many drawings are kept. */
const KEPT = 200;
const REDRAWN_ON = [
  "robots",
  "team",
  "tf",
  "goals",
  "markers",
  "obstacles",
  "sonars",
  "fiducials",
  "scans",
  "grids",
  "paths",
  "posearrays",
  "selection",
  "layers",
  "camera",
  "tool",
  "drive",
];

/** @typedef {ReturnType<typeof makeScene>} Scene */
/**
 * @typedef {{frames: number, js_ms: number[], age_ms: number[], bytes: number}} Stats
 * Drawings and bytes so far. Of the newest drawings: ms of JavaScript, with those for what came since the last one, and
 * the age of the poses that were drawn for the first time.
 */

/** @param {import("../app.js").App} app @param {HTMLElement} element @param {Stats} stats */
export function makeScene(app, element, stats) {
  const { store, camera } = app;
  const [lower, upper] = [document.createElement("canvas"), document.createElement("canvas")];
  element.append(lower, upper);
  const ctx = /** @type {CanvasRenderingContext2D} */ (upper.getContext("2d"));
  /** What has come since the last drawing. @type {Set<string>} */
  const changed = new Set(["theme"]);
  const below = makeBelow(app, lower, () => change("theme"));
  /** @type {import("./above.js").Painter[]} */
  const painters = [];
  let theme = readTheme(element),
    ratio = 1,
    pending = false,
    drawnFrame = -1,
    fitted = "";

  function requestDraw() {
    if (pending) return;
    pending = true;
    requestAnimationFrame(() => {
      pending = false;
      draw();
    });
  }

  /** @param {string} name */
  function change(name) {
    changed.add(name);
    requestDraw();
  }

  function draw() {
    const start = performance.now();
    /** @type {import("./paint.js").Pen} */
    const pen = { ctx, app, theme, ratio, radius: below.radius, taken: [] };
    const names = placeNames(pen),
      drawn = below.draw(changed, theme, ratio, names);
    paintAbove(pen, painters);
    if (!drawn) paintNames(pen, names);
    changed.clear();
    note(start);
  }

  /** @param {number} start ms */
  function note(start) {
    const now = performance.now(),
      { frame } = store;
    stats.frames++;
    stats.bytes = app.connection.bytes;
    keep(stats.js_ms, now - start + app.connection.decodingMs);
    app.connection.decodingMs = 0;
    if (frame.number === drawnFrame || frame.age < 0) return;
    drawnFrame = frame.number;
    keep(stats.age_ms, 1000 * frame.age + now - frame.received);
  }

  function resize() {
    const { clientWidth: width, clientHeight: height } = element;
    ratio = window.devicePixelRatio || 1;
    for (const canvas of [lower, upper]) {
      canvas.width = Math.max(1, Math.round(width * ratio));
      canvas.height = Math.max(1, Math.round(height * ratio));
    }
    camera.resize(width, height);
    fitFirst();
    // At once: a canvas is empty after a change of its size.
    draw();
  }

  /** Shows the whole map, or all robots if there is none. */
  function fit() {
    const box = boxOf(store);
    if (box) camera.fit(box);
  }

  /** Until the user moves the camera it fits what comes: a map, or without one the first robots. */
  function fitFirst() {
    if (camera.placed) return;
    const about = `${store.grids.size ? boxOf(store) : store.poses.count} ${camera.width} ${camera.height}`;
    if (about === fitted) return;
    fitted = about;
    fit();
    camera.placed = false;
  }

  function follow() {
    const pose = camera.follow >= 0 ? store.poses.at(camera.follow) : null;
    if (pose && (pose.x !== camera.x || pose.y !== camera.y)) camera.set({ x: pose.x, y: pose.y });
  }

  for (const name of REDRAWN_ON) store.on(name, () => change(name));
  store.on("theme", () => {
    theme = readTheme(element);
    change("theme");
  });
  store.on("robots", follow);
  store.on("robots", fitFirst);
  store.on("grids", fitFirst);
  new ResizeObserver(resize).observe(element);
  watchRatio(resize);

  return {
    element,
    painters,
    requestDraw,
    fit,
    radius: below.radius,
    /** A picture of both canvases. @returns {Promise<Blob>} */
    png() {
      draw();
      return pictureOf([lower, upper]);
    },
  };
}

/** @param {HTMLCanvasElement[]} canvases from below, of one size @returns {Promise<Blob>} */
function pictureOf(canvases) {
  const whole = document.createElement("canvas");
  [whole.width, whole.height] = [canvases[0].width, canvases[0].height];
  const ctx = /** @type {CanvasRenderingContext2D} */ (whole.getContext("2d"));
  for (const canvas of canvases) ctx.drawImage(canvas, 0, 0);
  return new Promise((resolve, reject) => {
    whole.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("no picture"))), "image/png");
  });
}

/** @param {number[]} list @param {number} value */
function keep(list, value) {
  list.push(value);
  if (list.length > KEPT) list.shift();
}

/** @param {import("../store.js").Store} store @returns {[number, number, number, number] | null} in map */
function boxOf(store) {
  for (const [key, tiles] of store.grids) {
    const meta = tiles.values().next().value?.meta;
    if (!meta || !isMap(key)) continue;
    return [meta.x, meta.y, meta.x + meta.width * meta.resolution, meta.y + meta.height * meta.resolution];
  }
  const { poses } = store;
  if (!poses.count) return null;
  const xs = poses.x.subarray(0, poses.count),
    ys = poses.y.subarray(0, poses.count);
  return [Math.min(...xs) - 2, Math.min(...ys) - 2, Math.max(...xs) + 2, Math.max(...ys) + 2];
}

/** Calls a function when the window comes to a screen of another density. @param {() => void} changed */
function watchRatio(changed) {
  const query = matchMedia(`(resolution: ${window.devicePixelRatio}dppx)`);
  query.addEventListener(
    "change",
    () => {
      changed();
      watchRatio(changed);
    },
    { once: true },
  );
}
