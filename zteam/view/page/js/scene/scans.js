/** Laser scans of all robots, as points or as the area that the beams cover, in one call. One row of a texture a scan:
 *   the
 * vertex shader makes beam ends of ranges and the sensor's pose. */

import { INVALID, NO_RETURN } from "../wire.js";
import { makeProgram, setFilter, useProgram } from "./gl.js";

const BEAM = `
uniform mat3 camera;
uniform usampler2D ranges;
uniform sampler2D rows;   // three texels a scan: x, y, yaw, first angle; angle step, range step, count, maximum; colour
uniform float size;
out vec4 tint;
uint rangeOf(int beam) { return texelFetch(ranges, ivec2(beam, gl_InstanceID), 0).r; }
vec2 endOf(int beam, vec4 a, vec4 b) {
  uint range = rangeOf(beam);
  float metres = range == ${NO_RETURN}u ? b.w : range == ${INVALID}u ? 0.0 : float(range) * b.y;
  float angle = a.z + a.w + float(beam) * b.x;
  return a.xy + metres * vec2(cos(angle), sin(angle));
}
void hide() { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); }`;

const POINTS = `${BEAM}
void main() {
  vec4 a = texelFetch(rows, ivec2(0, gl_InstanceID), 0), b = texelFetch(rows, ivec2(1, gl_InstanceID), 0);
  gl_PointSize = size;
  tint = texelFetch(rows, ivec2(2, gl_InstanceID), 0);
  if (gl_VertexID >= int(b.z) || rangeOf(gl_VertexID) >= ${INVALID}u) { hide(); return; }
  gl_Position = vec4((camera * vec3(endOf(gl_VertexID, a, b), 1.0)).xy, 0.0, 1.0);
}`;

const AREA = `${BEAM}
void main() {
  vec4 a = texelFetch(rows, ivec2(0, gl_InstanceID), 0), b = texelFetch(rows, ivec2(1, gl_InstanceID), 0);
  int beam = gl_VertexID / 3, corner = gl_VertexID % 3;
  tint = vec4(texelFetch(rows, ivec2(2, gl_InstanceID), 0).rgb, 1.0);
  if (beam + 1 >= int(b.z)) { hide(); return; }
  vec2 p = corner == 0 ? a.xy : endOf(beam + corner - 1, a, b);
  gl_Position = vec4((camera * vec3(p, 1.0)).xy, 0.0, 1.0);
}`;

const FRAGMENT = `
in vec4 tint;
out vec4 color;
void main() { color = tint; }`;

const TEXELS = 3;

/**
 * @param {WebGL2RenderingContext} gl
 */
export function makeScans(gl) {
  const points = makeProgram(gl, POINTS, FRAGMENT),
    area = makeProgram(gl, AREA, FRAGMENT);
  const empty = gl.createVertexArray(),
    ranges = gl.createTexture(),
    rows = gl.createTexture();
  for (const texture of [ranges, rows]) {
    gl.bindTexture(gl.TEXTURE_2D, texture);
    setFilter(gl, gl.NEAREST);
  }
  let width = 0,
    height = 0,
    count = 0,
    beams = 0;
  let cells = new Uint16Array(0),
    facts = new Float32Array(0);

  /** @param {number} wide @param {number} high */
  function grow(wide, high) {
    width = 2 ** Math.ceil(Math.log2(Math.max(wide, width, 64)));
    height = 2 ** Math.ceil(Math.log2(Math.max(high, height, 4)));
    cells = new Uint16Array(width * height);
    facts = new Float32Array(4 * TEXELS * height);
    gl.bindTexture(gl.TEXTURE_2D, ranges);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R16UI, width, height, 0, gl.RED_INTEGER, gl.UNSIGNED_SHORT, null);
    gl.bindTexture(gl.TEXTURE_2D, rows);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, TEXELS, height, 0, gl.RGBA, gl.FLOAT, null);
  }

  return {
    /** Take over all scans. @param {import("../store.js").Store} store @param {import("./colors.js").Theme} theme
     * @param {(robot: number) => boolean} shows whether a robot's are drawn */
    update(store, theme, shows) {
      const scans = [...store.scans.values()].filter(({ robot }) => shows(robot));
      count = scans.length;
      beams = 0;
      for (const scan of scans) beams = Math.max(beams, scan.ranges.length);
      if (beams > width || count > height) grow(beams, count);
      if (!count) return;
      let row = 0;
      for (const scan of scans) {
        cells.set(scan.ranges, row * width);
        writeFacts(facts, 4 * TEXELS * row++, scan, theme.robot(scan.robot));
      }
      gl.pixelStorei(gl.UNPACK_ALIGNMENT, 2);
      gl.bindTexture(gl.TEXTURE_2D, ranges);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, count, gl.RED_INTEGER, gl.UNSIGNED_SHORT, cells);
      gl.bindTexture(gl.TEXTURE_2D, rows);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, TEXELS, count, gl.RGBA, gl.FLOAT, facts);
    },

    /** @param {Float32Array} camera @param {boolean} asArea
     * @param {number} size of a point in device pixels, the same as long as the camera is */
    draw(camera, asArea, size) {
      if (!count || !beams) return;
      const program = asArea ? area : points,
        { at } = program;
      if (useProgram(gl, program, camera)) {
        gl.uniform1i(at.ranges, 0);
        gl.uniform1i(at.rows, 1);
        if (!asArea) gl.uniform1f(at.size, size);
      }
      gl.bindVertexArray(empty);
      gl.activeTexture(gl.TEXTURE1);
      gl.bindTexture(gl.TEXTURE_2D, rows);
      gl.activeTexture(gl.TEXTURE0);
      gl.bindTexture(gl.TEXTURE_2D, ranges);
      if (asArea) gl.drawArraysInstanced(gl.TRIANGLES, 0, 3 * (beams - 1), count);
      else gl.drawArraysInstanced(gl.POINTS, 0, beams, count);
    },
  };
}

/**
 * @param {Float32Array} facts @param {number} at the place of the row
 * @param {import("../wire.js").Scan} scan @param {import("./colors.js").Rgb} color
 */
function writeFacts(facts, at, scan, color) {
  facts[at] = scan.x;
  facts[at + 1] = scan.y;
  facts[at + 2] = scan.yaw;
  facts[at + 3] = scan.angleMin;
  facts[at + 4] = scan.angleIncrement;
  facts[at + 5] = scan.step;
  facts[at + 6] = scan.ranges.length;
  facts[at + 7] = scan.rangeMax;
  facts[at + 8] = color[0];
  facts[at + 9] = color[1];
  facts[at + 10] = color[2];
  facts[at + 11] = 1;
}
