/** The lower canvas: all that WebGL2 draws. */

import { ownerOf } from "../layers.js";
import { makeBodies, makeObstacles } from "./bodies.js";
import { makeCostmaps } from "./costmaps.js";
import { setOpacity } from "./gl.js";
import { isMap, makeGrids } from "./grids.js";
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
    costmaps: makeCostmaps(gl),
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
  /** Whether the layers of navigation show a robot. @param {number} robot */
  const navigates = (robot) => layers.showsRobot("navigation", robot);
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: false });
  let parts = gl && makeDrawings(gl);
  /** The names that the graphics processor has. @type {import("./names.js").Name[] | null} */
  let named = null;
  canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
  canvas.addEventListener("webglcontextrestored", () => {
    parts = gl && makeDrawings(gl);
    named = null;
    restored();
  });

  /** @param {NonNullable<typeof parts>} to @param {Set<string>} changed @param {Theme} theme */
  function takeChanges({ bodies, grids, trails, scans, plans, particles, obstacles }, changed, theme) {
    const anew = changed.has("theme") || changed.has("layers"),
      robots = changed.has("robots"),
      team = changed.has("team");
    if (anew || team) bodies.setTeam(store);
    if (anew || team || robots || changed.has("selection")) bodies.update(store, theme);
    if (changed.has("grids")) grids.forgetOld(store);
    if (robots) trails.update(store, theme);
    if (anew || changed.has("obstacles") || (robots && !store.docs.obstacles)) obstacles.update(store, theme);
    if (anew || team || changed.has("scans") || (robots && !store.scans.size)) scans.update(store, theme, (robot) => layers.showsRobot("sensors", robot));
    if (anew || changed.has("paths") || (robots && !store.paths.size)) plans.update(store, theme, navigates);
    if (anew || changed.has("posearrays") || (robots && !store.posearrays.size)) particles.update(store, theme, navigates);
  }

  /** @param {NonNullable<typeof parts>} to @param {Float32Array} matrix @param {Theme} theme */
  function drawCosts({ costmaps, grids }, matrix, theme) {
    const shows = (/** @type {string} */ key) => navigates(ownerOf(key));
    if (![...store.grids.keys()].some((key) => !isMap(key) && shows(key))) return;
    costmaps.draw(matrix, layers.opacity("costmaps") / 100, () => grids.draw(matrix, store, theme, true, 0, shows));
  }

  return {
    /** Whether the browser has WebGL2. */
    works: gl !== null,

    /** @param {number} id @returns {number} metres */
    radius: (id) => parts?.bodies.radius(id) ?? UNKNOWN_RADIUS,

    /** @param {number} id @returns {number} pixels from a robot's middle to its edge, as it is drawn */
    reach: (id) => parts?.bodies.reach(id, camera.scale) ?? UNKNOWN_RADIUS * camera.scale,

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
      /** Whether a layer is drawn, with its opacity. @param {string} name */
      const shows = (name) => {
        setOpacity(gl, layers.opacity(name) / 100);
        return layers.has(name);
      };
      if (shows("grid")) parts.mapGrid.draw(matrix, ratio, camera, theme);
      if (shows("map")) parts.grids.draw(matrix, store, theme, false, layers.has("grid") ? gridStep(scale) : 0);
      if (layers.has("costmaps")) drawCosts(parts, matrix, theme);
      if (shows("obstacles")) parts.obstacles.draw(matrix, scale, ratio);
      if (shows("beams")) parts.scans.draw(matrix, true, 1);
      if (shows("trails")) parts.trails.draw(matrix, ratio);
      if (shows("particles")) parts.particles.draw(matrix, ratio);
      if (shows("plans")) parts.plans.draw(matrix, ratio);
      if (shows("follow")) parts.links.draw(matrix, ratio, store, theme, scale, parts.bodies.radius);
      if (shows("scans")) {
        parts.scans.draw(matrix, false, Math.round(Math.min(MAX_POINT, Math.max(MIN_POINT, 0.06 * scale)) * ratio));
      }
      if (shows("robots")) parts.bodies.draw(matrix, scale, ratio, store.poses.left);
      setOpacity(gl, 1);
      if (names !== named) parts.names.update((named = names), ratio);
      parts.names.draw(matrix, store.poses.left);
      return true;
    },
  };
}
