/** Straight lines of a width in pixels, many at once: trails, plans, links from followers to leaders. */

import { makeProgram, setAttributes, useProgram } from "./gl.js";

const VERTEX = `
uniform mat3 camera;
uniform vec2 pixels;      // of the canvas
uniform float width;
uniform float now;
uniform float life;       // seconds until a line has faded; 0: never
layout(location = 0) in vec4 ends;
layout(location = 1) in vec4 tint;
layout(location = 2) in float born;
out vec4 color;
void main() {
  vec2 a = (camera * vec3(ends.xy, 1.0)).xy, b = (camera * vec3(ends.zw, 1.0)).xy;
  vec2 along = (b - a) * pixels;
  float length = max(length(along), 1e-6);
  vec2 side = vec2(-along.y, along.x) / length * width / pixels;
  vec2 end = along / length * 0.5 * width / pixels;
  vec2 p = (gl_VertexID & 1) == 0 ? a - end : b + end;
  gl_Position = vec4(p + ((gl_VertexID & 2) == 0 ? side : -side), 0.0, 1.0);
  float left = life > 0.0 ? clamp(1.0 - (now - born) / life, 0.0, 1.0) : 1.0;
  color = vec4(tint.rgb, 1.0) * tint.a * left;
}`;

const FRAGMENT = `
in vec4 color;
out vec4 result;
void main() { result = color; }`;

const WORDS = 6;

/**
 * A list of lines; `add` beyond the capacity takes the place of the oldest one.
 * @param {WebGL2RenderingContext} gl @param {number} capacity at first; @param {boolean} ring never grow
 */
export function makeSegments(gl, capacity, ring) {
  const lines = makeProgram(gl, VERTEX, FRAGMENT),
    { at } = lines;
  const buffer = gl.createBuffer(),
    array = gl.createVertexArray();
  let floats = new Float32Array(0),
    words = new Uint32Array(0);
  let count = 0,
    next = 0,
    dirtyFrom = Infinity,
    dirtyTo = 0;

  /** @param {number} size */
  function allocate(size) {
    const old = words;
    floats = new Float32Array(size * WORDS);
    words = new Uint32Array(floats.buffer);
    words.set(old);
    capacity = size;
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, floats.byteLength, gl.DYNAMIC_DRAW);
    const attributes = [
      { place: 0, size: 4, offset: 0 },
      { place: 1, size: 4, type: gl.UNSIGNED_BYTE, normalized: true, offset: 16 },
      { place: 2, size: 1, offset: 20 },
    ];
    setAttributes(gl, attributes, 4 * WORDS, 1);
    [dirtyFrom, dirtyTo] = [0, count];
  }
  allocate(capacity);

  return {
    clear() {
      count = next = 0;
      [dirtyFrom, dirtyTo] = [Infinity, 0];
    },

    /**
     * @param {number} ax
     * @param {number} ay
     * @param {number} bx
     * @param {number} by in map
     * @param {number} color packed
     * @param {number} [born] s
     */
    add(ax, ay, bx, by, color, born = 0) {
      if (next === capacity) {
        if (ring) next = 0;
        else allocate(2 * capacity);
      }
      const i = next * WORDS;
      floats[i] = ax;
      floats[i + 1] = ay;
      floats[i + 2] = bx;
      floats[i + 3] = by;
      words[i + 4] = color;
      floats[i + 5] = born;
      dirtyFrom = Math.min(dirtyFrom, next);
      dirtyTo = Math.max(dirtyTo, ++next);
      count = Math.max(count, next);
    },

    /**
     * @param {Float32Array} camera
     * @param {number} width of a line in device pixels, the same as long as the camera is
     * @param {number} [now] s
     * @param {number} [life] s, always the same
     */
    draw(camera, width, now = 0, life = 0) {
      if (!count) return;
      gl.bindVertexArray(array);
      if (dirtyFrom < dirtyTo) {
        gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
        gl.bufferSubData(
          gl.ARRAY_BUFFER,
          4 * WORDS * dirtyFrom,
          floats,
          WORDS * dirtyFrom,
          WORDS * (dirtyTo - dirtyFrom),
        );
        [dirtyFrom, dirtyTo] = [Infinity, 0];
      }
      if (useProgram(gl, lines, camera)) {
        gl.uniform2f(at.pixels, gl.drawingBufferWidth, gl.drawingBufferHeight);
        gl.uniform1f(at.width, width);
        gl.uniform1f(at.life, life);
      }
      if (life) gl.uniform1f(at.now, now);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
    },
  };
}
