/** Occupancy grids: the map, crisp, and costmaps above it. One texture a tile. */

import { makeProgram, setFilter, useProgram } from "./gl.js";

const VERTEX = `
uniform mat3 camera;
uniform vec4 pose;      // x, y, cos, sin of the grid in map
uniform vec4 box;       // of the tile in the grid: x, y, width, height in metres
out vec2 place;
out vec2 at;            // in map
void main() {
  place = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  vec2 p = box.xy + place * box.zw;
  vec2 q = pose.xy + vec2(pose.z * p.x - pose.w * p.y, pose.w * p.x + pose.z * p.y);
  at = q;
  gl_Position = vec4((camera * vec3(q, 1.0)).xy, 0.0, 1.0);
}`;

// Red: how likely the cell is occupied, green: whether it is known. Where many cells share a pixel the mean is shown; the
// boost keeps walls of one cell visible then. Lines of the grid are drawn here, so that they never cross a wall.
const MAP_FRAGMENT = `
uniform sampler2D cells;
uniform vec3 free, occupied, unknown;
uniform float boost;
uniform vec4 grid;      // colour of its lines on free ground, and metres between them; 0: none
uniform float pixel;    // metres
in vec2 place, at;
out vec4 color;
void main() {
  vec2 cell = texture(cells, place).rg;
  vec2 line = grid.w > 0.0 ? abs(fract(at / grid.w + 0.5) - 0.5) * grid.w / pixel : vec2(1.0);
  vec3 ground = mix(grid.rgb, free, clamp(min(line.x, line.y) * 2.0 - 0.5, 0.0, 1.0));
  float share = cell.r / max(cell.g, 0.004);
  color = vec4(mix(unknown, mix(ground, occupied, min(1.0, share * (1.0 + boost))), cell.g), 1.0);
}`;

const COST_FRAGMENT = `
uniform sampler2D cells;
in vec2 place;
out vec4 color;
void main() {
  vec2 cell = texture(cells, place).rg;
  color = vec4(cell.g < 0.5 ? 0.0 : cell.r);
}`;

/** @param {string} key @returns {boolean} whether a grid is the map; all others are costs */
export function isMap(key) {
  return key === "map" || key.endsWith("/map");
}

/** @param {WebGL2RenderingContext} gl */
export function makeGrids(gl) {
  const map = makeProgram(gl, VERTEX, MAP_FRAGMENT),
    cost = makeProgram(gl, VERTEX, COST_FRAGMENT);
  const empty = gl.createVertexArray();
  /** @type {Map<import("../store.js").GridTile, WebGLTexture>} */
  const textures = new Map();
  /** What the map's colours were set for. */
  let ofTheme = /** @type {import("./colors.js").Theme | null} */ (null),
    ofStep = -1;

  return {
    /** Give back the textures of tiles that are gone. @param {import("../store.js").Store} store */
    forgetOld(store) {
      const live = new Set([...store.grids.values()].flatMap((tiles) => [...tiles.values()]));
      for (const [tile, texture] of textures) {
        if (live.has(tile)) continue;
        gl.deleteTexture(texture);
        textures.delete(tile);
      }
    },

    /**
     * @param {Float32Array} camera
     * @param {import("../store.js").Store} store
     * @param {import("./colors.js").Theme} theme
     * @param {boolean} costs as red, for `makeCostmaps`
     * @param {number} step metres between the lines of the grid; 0: none
     * @param {(key: string) => boolean} [shows] whether a grid is drawn
     */
    draw(camera, store, theme, costs, step, shows) {
      const program = costs ? cost : map,
        { at } = program,
        moved = useProgram(gl, program, camera);
      gl.bindVertexArray(empty);
      const pixel = 2 / (Math.hypot(camera[0], camera[3]) * gl.drawingBufferWidth);
      if (!costs && (moved || theme !== ofTheme || step !== ofStep)) {
        for (const name of /** @type {const} */ (["free", "occupied", "unknown"])) gl.uniform3fv(at[name], theme[name]);
        gl.uniform4f(at.grid, ...theme.grid, step);
        gl.uniform1f(at.pixel, pixel);
        [ofTheme, ofStep] = [theme, step];
      }
      for (const [key, tiles] of store.grids) {
        if (isMap(key) === costs || (shows && !shows(key))) continue;
        let first = true;
        for (const tile of tiles.values()) {
          const { x, y, yaw, resolution: r, tile: part } = tile.meta;
          let texture = textures.get(tile);
          if (texture) gl.bindTexture(gl.TEXTURE_2D, texture);
          else textures.set(tile, (texture = makeTexture(gl, tile)));
          if (first) gl.uniform4f(at.pose, x, y, Math.cos(yaw), Math.sin(yaw));
          if (first && !costs) gl.uniform1f(at.boost, Math.min(3, Math.max(0, pixel / r - 1)));
          first = false;
          gl.uniform4f(at.box, part[0] * r, part[1] * r, part[2] * r, part[3] * r);
          gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
        }
      }
    },
  };
}

/** @param {WebGL2RenderingContext} gl @param {import("../store.js").GridTile} tile */
function makeTexture(gl, { meta, cells }) {
  const [, , width, height] = meta.tile;
  const texture = /** @type {WebGLTexture} */ (gl.createTexture());
  const pixels = new Uint8Array(2 * width * height);
  for (let i = 0; i < width * height; i++) {
    if (cells[i] < 0) continue;
    pixels[2 * i] = Math.round(2.55 * cells[i]);
    pixels[2 * i + 1] = 255;
  }
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RG8, width, height, 0, gl.RG, gl.UNSIGNED_BYTE, pixels);
  setFilter(gl, gl.NEAREST);
  if (isMap(meta.key)) {
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    gl.generateMipmap(gl.TEXTURE_2D);
  }
  return texture;
}
