/** The map area: two canvases, drawn when something has changed. */

import { makeBodies } from "./bodies.js";
import { readTheme } from "./colors.js";
import { paintFrames } from "./frames.js";
import { paintGoals } from "./goals.js";
import { isMap, makeGrids } from "./grids.js";
import { paintLabels } from "./labels.js";
import { gridStep, makeLinks, makeMapGrid, makeParticles, makePlans, makeTrails } from "./lines.js";
import { paintMarkers, paintObstacles } from "./markers.js";
import { inPixels } from "./paint.js";
import { paintRuler } from "./ruler.js";
import { makeScans } from "./scans.js";

const KEPT = 200;
const REDRAWN_ON = ["robots", "team", "tf", "goals", "markers", "obstacles", "scans", "grids", "paths", "posearrays", "selection", "layers", "camera", "tool", "drive", "frame"];

/** @typedef {ReturnType<typeof makeScene>} Scene */
/** @typedef {(pen: import("./paint.js").Pen) => void} Painter */

/**
 * @param {import("../app.js").App} app @param {HTMLElement} element @param {{frames: number, js_ms: number[], age_ms: number[], bytes: number}} stats
 */
export function makeScene(app, element, stats) {
  const { store, camera, layers } = app;
  const [below, above] = [document.createElement("canvas"), document.createElement("canvas")];
  element.append(below, above);
  const ctx = /** @type {CanvasRenderingContext2D} */ (above.getContext("2d"));
  const gl = below.getContext("webgl2", { antialias: true, alpha: false });
  /** @type {ReturnType<typeof makeDrawings> | null} */
  let drawings = gl && makeDrawings(gl);
  let theme = readTheme(element), ratio = 1, pending = false, drawnFrame = -1;
  /** What has come since the last drawing. @type {Set<string>} */
  const changed = new Set();
  /** @type {Painter[]} painters of the tools, above all others */
  const painters = [];

  function requestDraw() {
    if (pending) return;
    pending = true;
    requestAnimationFrame(draw);
  }

  function draw() {
    pending = false;
    const start = performance.now();
    if (gl && drawings && !gl.isContextLost()) drawBelow(gl, drawings);
    drawAbove();
    changed.clear();
    note(start);
  }

  /** @param {WebGL2RenderingContext} gl @param {ReturnType<typeof makeDrawings>} parts */
  function drawBelow(gl, parts) {
    takeChanges(parts);
    const matrix = camera.matrix();
    gl.viewport(0, 0, below.width, below.height);
    gl.clearColor(...theme.background, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    if (layers.has("grid")) parts.mapGrid.draw(matrix, ratio, camera, theme);
    if (layers.has("map")) parts.grids.draw(matrix, store, theme, false, layers.has("grid") ? gridStep(camera.scale) : 0);
    if (layers.has("costmaps")) parts.grids.draw(matrix, store, theme, true, 0);
    if (layers.has("beams")) parts.scans.draw(matrix, true, 1);
    if (layers.has("trails")) parts.trails.draw(matrix, ratio);
    if (layers.has("particles")) parts.particles.draw(matrix, ratio);
    if (layers.has("plans")) parts.plans.draw(matrix, ratio);
    if (layers.has("follow")) parts.links.draw(matrix, ratio, store, theme, camera.scale, parts.bodies.radius);
    if (layers.has("robots")) parts.bodies.draw(matrix, camera.scale, ratio);
    if (layers.has("scans")) parts.scans.draw(matrix, false, Math.round(Math.min(4, Math.max(2, 0.06 * camera.scale)) * ratio));
  }

  /** @param {ReturnType<typeof makeDrawings>} parts */
  function takeChanges(parts) {
    const colors = changed.has("theme");
    if (colors || changed.has("team")) parts.bodies.setTeam(store);
    if (colors || changed.has("robots") || changed.has("team") || changed.has("selection")) parts.bodies.update(store, theme);
    if (changed.has("robots")) parts.trails.update(store, theme);
    if (colors || changed.has("scans") || changed.has("team") || changed.has("robots") && !store.scans.size) parts.scans.update(store, theme);
    if (colors || changed.has("paths")) parts.plans.update(store, theme);
    if (colors || changed.has("posearrays")) parts.particles.update(store, theme);
  }

  function drawAbove() {
    const pen = { ctx, app, theme, ratio, radius: (/** @type {number} */ id) => drawings?.bodies.radius(id) ?? 0.2 };
    ctx.setTransform(1, 0, 0, 1, 0, 0);
    ctx.clearRect(0, 0, above.width, above.height);
    inPixels(pen);
    if (layers.has("obstacles")) paintObstacles(pen);
    if (["markers", "sonars", "fiducials"].some((name) => layers.has(name))) paintMarkers(pen);
    if (layers.has("tf")) paintFrames(pen);
    if (layers.has("goals")) paintGoals(pen);
    paintLabels(pen);
    paintRuler(pen);
    for (const paint of painters) paint(pen);
  }

  /** @param {number} start ms */
  function note(start) {
    const now = performance.now(), { frame } = store;
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
    for (const canvas of [below, above]) {
      canvas.width = Math.max(1, Math.round(width * ratio));
      canvas.height = Math.max(1, Math.round(height * ratio));
    }
    camera.resize(width, height);
    if (!camera.placed) fit();
    // At once: a canvas is empty after a change of its size.
    draw();
  }

  /** Shows the whole map, or all robots if there is none. */
  function fit() {
    const box = boxOf(store);
    if (box) camera.fit(box);
  }

  for (const name of REDRAWN_ON) {
    store.on(name, () => {
      changed.add(name);
      requestDraw();
    });
  }
  store.on("theme", () => {
    theme = readTheme(element);
    changed.add("theme");
    requestDraw();
  });
  store.on("robots", () => {
    const pose = camera.follow >= 0 ? store.poses.at(camera.follow) : null;
    if (pose && (pose.x !== camera.x || pose.y !== camera.y)) camera.set({ x: pose.x, y: pose.y });
  });
  const fitFirst = () => {
    if (camera.placed) return;
    fit();
    // Until the user moves the camera it goes on fitting what comes, such as the other tiles of the map.
    camera.placed = false;
  };
  store.on("grids", fitFirst);
  store.on("robots", fitFirst);
  below.addEventListener("webglcontextlost", (event) => event.preventDefault());
  below.addEventListener("webglcontextrestored", () => {
    drawings = gl && makeDrawings(gl);
    for (const name of ["theme", ...REDRAWN_ON]) changed.add(name);
    requestDraw();
  });
  new ResizeObserver(resize).observe(element);
  watchRatio(resize);
  if (!gl) app.say("This browser has no WebGL2: map, lasers and robots cannot be drawn.", "error");

  return {
    element,
    painters,
    requestDraw,
    fit,
    /** @param {number} id @returns {number} metres */
    radius: (id) => drawings?.bodies.radius(id) ?? 0.2,
    /** A picture of both canvases. @returns {Promise<Blob>} */
    png() {
      draw();
      const whole = document.createElement("canvas");
      [whole.width, whole.height] = [below.width, below.height];
      const pen = /** @type {CanvasRenderingContext2D} */ (whole.getContext("2d"));
      for (const canvas of [below, above]) pen.drawImage(canvas, 0, 0);
      return new Promise((resolve, reject) => whole.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("no picture"))), "image/png"));
    },
  };
}

/** @param {WebGL2RenderingContext} gl */
function makeDrawings(gl) {
  return {
    grids: makeGrids(gl), scans: makeScans(gl), bodies: makeBodies(gl), mapGrid: makeMapGrid(gl), trails: makeTrails(gl), links: makeLinks(gl),
    plans: makePlans(gl), particles: makeParticles(gl),
  };
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
  const xs = poses.x.subarray(0, poses.count), ys = poses.y.subarray(0, poses.count);
  return [Math.min(...xs) - 2, Math.min(...ys) - 2, Math.max(...xs) + 2, Math.max(...ys) + 2];
}

/** Calls a function when the window comes to a screen of another density. @param {() => void} changed */
function watchRatio(changed) {
  const query = matchMedia(`(resolution: ${window.devicePixelRatio}dppx)`);
  query.addEventListener("change", () => {
    changed();
    watchRatio(changed);
  }, { once: true });
}
