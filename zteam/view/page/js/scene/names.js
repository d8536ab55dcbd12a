/** Names of robots as pictures of text: each is drawn once and kept in one texture, and all are shown in one call. */

import { makeProgram, setAttributes, setFilter, useProgram } from "./gl.js";

const VERTEX = `
uniform vec2 pixels;      // of the canvas
uniform float side;       // of the texture
uniform float left;       // share of the way that is left
layout(location = 0) in vec4 box;     // left, top, width, height in device pixels
layout(location = 1) in vec2 slot;    // left, top in the texture
layout(location = 2) in vec2 way;     // of its robot, in device pixels
out vec2 place;
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * box.zw;
  vec2 p = (round(box.xy - left * way) + corner) / pixels;
  gl_Position = vec4(2.0 * p.x - 1.0, 1.0 - 2.0 * p.y, 0.0, 1.0);
  place = (slot + corner) / side;
}`;

const FRAGMENT = `
uniform sampler2D pictures;
in vec2 place;
out vec4 color;
void main() { color = texture(pictures, place); }`;

const WORDS = 8;
/** Texels of the texture along each side, for each device pixel of a CSS pixel: for about 800 names. */
const SIDE = 1024;

/** @typedef {import("./paint.js").Sprite} Sprite */
/** @typedef {{sprite: Sprite, px: number, py: number, dx: number, dy: number, leader: number[] | null, robot: number}} Name
 *   a picture, its middle, the way that its robot goes to its newest pose, and the ends of a line to the robot if it does
 *   not touch it: x, y, x, y. In CSS pixels */

/** @param {WebGL2RenderingContext} gl */
export function makeNames(gl) {
  const names = makeProgram(gl, VERTEX, FRAGMENT),
    { at } = names;
  const most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
  const array = gl.createVertexArray(),
    buffer = gl.createBuffer();
  /** @type {WebGLTexture | null} */
  let texture = null;
  let side = 0,
    count = 0,
    floats = new Float32Array(0);
  /** Where each picture lies in the texture. @type {Map<Sprite, [number, number]>} */
  const slots = new Map();
  /** Where the next one goes, and the height of its row. */
  let x = 0,
    y = 0,
    tall = 0;

  /** @param {number} size texels */
  function begin(size) {
    slots.clear();
    x = y = tall = 0;
    if (size === side) return;
    side = size;
    gl.deleteTexture(texture);
    texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, side, side);
    setFilter(gl, gl.NEAREST);
  }

  /** @param {Sprite} sprite @returns {[number, number] | null} null: the texture is full */
  function slotOf(sprite) {
    let slot = slots.get(sprite) ?? null;
    if (slot) return slot;
    const { width, height } = sprite.canvas;
    if (x + width > side) [x, y, tall] = [0, y + tall, 0];
    if (width > side || y + height > side) return null;
    slots.set(sprite, (slot = [x, y]));
    x += width;
    tall = Math.max(tall, height);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, true);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, ...slot, gl.RGBA, gl.UNSIGNED_BYTE, sprite.canvas);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
    return slot;
  }

  /** @param {number} size names */
  function grow(size) {
    floats = new Float32Array(size * WORDS);
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, floats.byteLength, gl.DYNAMIC_DRAW);
    const attributes = [
      { place: 0, size: 4, offset: 0 },
      { place: 1, size: 2, offset: 16 },
      { place: 2, size: 2, offset: 24 },
    ];
    setAttributes(gl, attributes, 4 * WORDS, 1);
  }

  return {
    /** Take over all names. @param {Name[]} shown @param {number} ratio device pixels a CSS pixel @returns {void} */
    update(shown, ratio) {
      const size = Math.min(SIDE * Math.ceil(ratio), most);
      if (size !== side) begin(size);
      if (shown.length * WORDS > floats.length) grow(2 * shown.length);
      count = 0;
      for (const { sprite, px, py, dx, dy } of shown) {
        const slot = slotOf(sprite);
        if (!slot) {
          // Those that are no longer shown make room; if all are, the rest has no name.
          if (slots.size <= count) break;
          begin(side);
          return this.update(shown, ratio);
        }
        const { width, height } = sprite.canvas,
          i = WORDS * count++;
        floats[i] = Math.round(px * ratio - width / 2);
        floats[i + 1] = Math.round(py * ratio - height / 2);
        floats[i + 2] = width;
        floats[i + 3] = height;
        floats[i + 4] = slot[0];
        floats[i + 5] = slot[1];
        floats[i + 6] = dx * ratio;
        floats[i + 7] = dy * ratio;
      }
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, floats, 0, WORDS * count);
    },

    /** @param {Float32Array} camera @param {number} left share of the robots' ways that is left */
    draw(camera, left) {
      if (!count) return;
      if (useProgram(gl, names, camera)) gl.uniform2f(at.pixels, gl.drawingBufferWidth, gl.drawingBufferHeight);
      gl.uniform1f(at.side, side);
      gl.uniform1f(at.left, left);
      gl.bindVertexArray(array);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
    },
  };
}
