/** The map area: two canvases, drawn when something has changed. */

import { paintAbove } from "./above.js";
import { makeBelow } from "./below.js";
import { readTheme } from "./colors.js";
import { isMap } from "./grids.js";
import { makeKeeper } from "./keeping.js";
import { paintNames, placeNames } from "./labels.js";
import { makeOutside } from "./outside.js";

/** Figures of so many drawings are kept. */
const KEPT = 200;
/** Milliseconds from the request of a picture that count at most. */
const MOST_WAIT = 1000;
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
/** What moves names or changes them. */
const NAMED_ON = ["robots", "team", "selection", "layers", "camera", "drive", "theme"];

/** @typedef {ReturnType<typeof makeScene>} Scene */
/**
 * @typedef {{frames: number, js_ms: number[], arrival_ms: number[], age_ms: number[], bytes: number}} Stats
 * Drawings and bytes so far. Of the newest drawings: ms of JavaScript, with those for what came since the last one, and
 * the age of the poses that were drawn for the first time, when they came and when they were drawn.
 */

/** @param {import("../app.js").App} app @param {HTMLElement} element @param {Stats} stats */
export function makeScene(app, element, stats) {
  const { store, camera } = app;
  const [lower, upper] = [document.createElement("canvas"), document.createElement("canvas")];
  /** @type {HTMLElement} */ (element.querySelector("#map")).append(lower, upper);
  const ctx = /** @type {CanvasRenderingContext2D} */ (upper.getContext("2d"));
  /** What has come since the last drawing. @type {Set<string>} */
  const changed = new Set(["theme"]);
  const below = makeBelow(app, lower, () => change("theme"));
  /** @type {import("./above.js").Painter[]} */
  const painters = [];
  const outside = makeOutside(app, element);
  const keeper = makeKeeper(app, () => mapBox(store));
  let theme = readTheme(element),
    ratio = 1,
    pending = false,
    drawnFrame = -1,
    asked = 0,
    waited = 0;
  /** Those of the last drawing. @type {import("./names.js").Name[]} */
  let names = [];
  /** Their places. @type {import("./paint.js").Box[]} */
  let named = [];

  function requestDraw() {
    if (pending) return;
    pending = true;
    asked = performance.now();
    requestAnimationFrame(() => {
      pending = false;
      // A page that is not seen draws nothing for hours.
      waited += 0.2 * (Math.min(performance.now() - asked, MOST_WAIT) - waited);
      draw();
    });
  }

  /** @param {string} name */
  function change(name) {
    changed.add(name);
    requestDraw();
  }

  function draw() {
    const start = performance.now(),
      moves = moveRobots(start),
      goesOn = keeper.step(start) || moves;
    follow();
    // A scan is drawn from halfway on: then its robot is nearest to where it was seen.
    const later = store.poses.left > 0.5 && changed.delete("scans");
    /** @type {import("./paint.js").Pen} */
    const pen = { ctx, app, theme, ratio, radius: below.radius, reach: below.reach, names, taken: [] };
    if (NAMED_ON.some((name) => changed.has(name))) {
      pen.names = names = placeNames(pen);
      named = [...pen.taken];
      outside.update(theme);
    } else pen.taken.push(...named);
    const drawn = below.draw(changed, theme, ratio, names);
    paintAbove(pen, painters);
    if (!drawn) paintNames(pen, names);
    changed.clear();
    if (later) changed.add("scans");
    note(start);
    if (goesOn) requestDraw();
  }

  /** Between two poses the robots are drawn on their way, unless the world stands or too few pictures would come.
   * @param {number} now ms @returns {boolean} whether they will be elsewhere in the next picture */
  function moveRobots(now) {
    const { poses, team } = store,
      stands = team !== null && !["running", ""].includes(team.sim.state);
    if (!stands && waited < poses.period / 2) return poses.drawAt(now);
    poses.arrive();
    return false;
  }

  /** @param {number} start ms */
  function note(start) {
    const now = performance.now(),
      { posed } = store;
    stats.frames++;
    stats.bytes = app.connection.bytes;
    keep(stats.js_ms, now - start + app.connection.decodingMs);
    app.connection.decodingMs = 0;
    if (posed.number === drawnFrame) return;
    drawnFrame = posed.number;
    keep(stats.arrival_ms, 1000 * posed.age);
    keep(stats.age_ms, 1000 * posed.age + now - posed.received);
  }

  function resize() {
    const { clientWidth: width, clientHeight: height } = element;
    ratio = window.devicePixelRatio || 1;
    for (const canvas of [lower, upper]) {
      canvas.width = Math.max(1, Math.round(width * ratio));
      canvas.height = Math.max(1, Math.round(height * ratio));
    }
    camera.resize(width, height);
    // At once: a canvas is empty after a change of its size.
    draw();
  }

  /** Shows the whole map, or all robots if there is none. */
  function fit() {
    const box = mapBox(store);
    if (box) camera.fit(box);
    else keeper.begin();
  }

  function follow() {
    const pose = camera.follow >= 0 ? store.poses.drawn(camera.follow) : null;
    if (pose && (pose.x !== camera.x || pose.y !== camera.y)) camera.set({ x: pose.x, y: pose.y });
  }

  for (const name of REDRAWN_ON) store.on(name, () => change(name));
  store.on("theme", () => {
    theme = readTheme(element);
    change("theme");
  });
  for (const name of ["robots", "grids"]) store.on(name, () => keeper.step(performance.now()));
  new ResizeObserver(resize).observe(element);
  watchRatio(resize);

  return {
    element,
    painters,
    requestDraw,
    fit,
    /** Shows the team, and keeps it in view until the user moves the map. */
    keepTeam: () => keeper.begin(),
    radius: below.radius,
    works: below.works,
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

/** @typedef {[number, number, number, number]} Extent xmin, ymin, xmax, ymax in map */

/** @param {import("../store.js").Store} store @returns {Extent | null} */
function mapBox({ grids }) {
  for (const [key, tiles] of grids) {
    const meta = tiles.values().next().value?.meta;
    if (!meta || !isMap(key)) continue;
    return [meta.x, meta.y, meta.x + meta.width * meta.resolution, meta.y + meta.height * meta.resolution];
  }
  return null;
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
