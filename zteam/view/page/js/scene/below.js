/** The lower canvas: all that WebGL2 draws. */

import { makeBodies, makeObstacles } from "./bodies.js";
import { makeGrids } from "./grids.js";
import { gridStep, makeLinks, makeMapGrid, makeParticles, makePlans, makeTrails } from "./lines.js";
import { makeNames } from "./names.js";
import { makeScans } from "./scans.js";

/** Radius of a robot in metres before its outline is known. */
const UNKNOWN_RADIUS = 0.2;
/** Pixels of a laser point. */
const MIN_POINT = 2,
  MAX_POINT = 4;

/** @typedef {import("./colors.js").Theme} Theme */

/** @param {WebGL2RenderingContext} gl */
function makeDrawings(gl) {
  return {
    grids: makeGrids(gl),
    scans: makeScans(gl),
    bodies: makeBodies(gl),
    names: makeNames(gl),
    mapGrid: makeMapGrid(gl),
    trails: makeTrails(gl),
    links: makeLinks(gl),
    plans: makePlans(gl),
    particles: makeParticles(gl),
    obstacles: makeObstacles(gl),
  };
}

/**
 * @param {import("../app.js").App} app
 * @param {HTMLCanvasElement} canvas
 * @param {() => void} restored the browser gave the context back:
 * everything has to be drawn anew
 */
export function makeBelow(app, canvas, restored) {
  const { store, camera, layers } = app;
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: false });
  let parts = gl && makeDrawings(gl);
  // What shows it to the user is mounted later.
  if (!gl) queueMicrotask(() => app.say("This browser has no WebGL2: map, lasers and robots cannot be drawn", "error"));
  canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
  canvas.addEventListener("webglcontextrestored", () => {
    parts = gl && makeDrawings(gl);
    restored();
  });

  /** @param {NonNullable<typeof parts>} to @param {Set<string>} changed @param {Theme} theme */
  function takeChanges({ bodies, trails, scans, plans, particles, obstacles }, changed, theme) {
    const anew = changed.has("theme"),
      robots = changed.has("robots"),
      team = changed.has("team");
    if (anew || team) bodies.setTeam(store);
    if (anew || team || robots || changed.has("selection")) bodies.update(store, theme);
    if (robots) trails.update(store, theme);
    if (anew || changed.has("obstacles") || (robots && !store.docs.obstacles)) obstacles.update(store, theme);
    if (anew || team || changed.has("scans") || (robots && !store.scans.size)) scans.update(store, theme);
    if (anew || changed.has("paths") || (robots && !store.paths.size)) plans.update(store, theme);
    if (anew || changed.has("posearrays") || (robots && !store.posearrays.size)) particles.update(store, theme);
  }

  return {
    /** @param {number} id @returns {number} metres */
    radius: (id) => parts?.bodies.radius(id) ?? UNKNOWN_RADIUS,

    /**
     * @param {Set<string>} changed events since the last drawing
     * @param {Theme} theme
     * @param {number} ratio device pixels a CSS pixel
     * @param {import("./names.js").Name[]} names of robots
     * @returns {boolean} whether it could draw
     */
    draw(changed, theme, ratio, names) {
      if (!gl || !parts || gl.isContextLost()) return false;
      takeChanges(parts, changed, theme);
      const matrix = camera.matrix(),
        { scale } = camera;
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.clearColor(...theme.background, 1);
      gl.clear(gl.COLOR_BUFFER_BIT);
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      if (layers.has("grid")) parts.mapGrid.draw(matrix, ratio, camera, theme);
      if (layers.has("map")) parts.grids.draw(matrix, store, theme, false, layers.has("grid") ? gridStep(scale) : 0);
      if (layers.has("costmaps")) parts.grids.draw(matrix, store, theme, true, 0);
      if (layers.has("obstacles")) parts.obstacles.draw(matrix, scale, ratio);
      if (layers.has("beams")) parts.scans.draw(matrix, true, 1);
      if (layers.has("trails")) parts.trails.draw(matrix, ratio);
      if (layers.has("particles")) parts.particles.draw(matrix, ratio);
      if (layers.has("plans")) parts.plans.draw(matrix, ratio);
      if (layers.has("follow")) parts.links.draw(matrix, ratio, store, theme, scale, parts.bodies.radius);
      if (layers.has("scans")) {
        parts.scans.draw(matrix, false, Math.round(Math.min(MAX_POINT, Math.max(MIN_POINT, 0.06 * scale)) * ratio));
      }
      if (layers.has("robots")) parts.bodies.draw(matrix, scale, ratio);
      parts.names.update(names, ratio);
      parts.names.draw(matrix);
      return true;
    },
  };
}
