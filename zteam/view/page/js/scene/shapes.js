/** Things with outlines, filled and with an edge: many of one shape in one call. */

import { makeProgram, setAttributes, useProgram } from "./gl.js";
import { frontOf, radiusOf, reachOf, triangulate } from "./polygons.js";

const VERTEX = `
uniform mat3 camera;
uniform vec2 pixels;
uniform float grow;                       // so that a far robot is still seen
uniform float left;                       // of the way to the pose
uniform vec2 widths;                      // of an edge, and of a selected robot's, in device pixels
layout(location = 0) in vec4 ends;        // of an edge; a filled corner has both the same
layout(location = 1) in vec2 kind;        // which corner of the edge's quad (-1: filled), 1: of the mark at the front
layout(location = 2) in vec3 pose;
layout(location = 3) in vec4 fill;
layout(location = 4) in vec4 edge;
layout(location = 5) in float selected;
layout(location = 6) in vec3 way;
out vec4 color;
vec2 place(vec2 p) {
  vec2 q = grow * p;
  vec3 at = pose - left * way;
  float c = cos(at.z), s = sin(at.z);
  return (camera * vec3(at.xy + vec2(c * q.x - s * q.y, s * q.x + c * q.y), 1.0)).xy;
}
void main() {
  vec2 a = place(ends.xy);
  color = kind.x < 0.0 && kind.y < 0.5 ? vec4(fill.rgb, 1.0) * fill.a : vec4(edge.rgb, 1.0) * edge.a;
  if (kind.x < 0.0) { gl_Position = vec4(a, 0.0, 1.0); return; }
  vec2 b = place(ends.zw), along = (b - a) * pixels;
  float width = selected > 0.5 ? widths.y : widths.x;
  vec2 unit = along / max(length(along), 1e-6);
  vec2 side = vec2(-unit.y, unit.x) * width / pixels, end = unit * 0.5 * width / pixels;
  int corner = int(kind.x);
  vec2 p = (corner & 1) == 0 ? a - end : b + end;
  gl_Position = vec4(p + ((corner & 2) == 0 ? side : -side), 0.0, 1.0);
}`;

const FRAGMENT = `
in vec4 color;
out vec4 result;
void main() { result = color; }`;

const WORDS = 9;
const QUAD = [0, 1, 2, 2, 1, 3];

/** @typedef {[number, number][][]} Outline polygons in metres, in the thing's own frame */
/** @typedef {{radius: number, reach: number, vertices: number, array: WebGLVertexArrayObject, instances: WebGLBuffer, floats:
 *   Float32Array,
 *  words: Uint32Array, count: number}} Mesh */

/**
 * @param {Outline} outline
 * @param {boolean} marked whether it has a mark at the front
 * @returns {Float32Array} six floats a vertex: ends, kind
 */
function verticesOf(outline, marked) {
  /** @type {number[]} */
  const vertices = [];
  for (const polygon of outline) {
    const corners = triangulate(polygon);
    for (let i = 0; i < corners.length; i += 2) {
      vertices.push(corners[i], corners[i + 1], corners[i], corners[i + 1], -1, 0);
    }
  }
  const front = frontOf(outline),
    size = 0.55 * Math.min(front, radiusOf(outline));
  for (const [x, y] of !marked
    ? []
    : [
        [front * 0.92, 0],
        [front * 0.92 - size, 0.5 * size],
        [front * 0.92 - size, -0.5 * size],
      ]) {
    vertices.push(x, y, x, y, -1, 1);
  }
  for (const polygon of outline) {
    polygon.forEach(([x, y], i) => {
      const [nextX, nextY] = polygon[(i + 1) % polygon.length];
      for (const corner of QUAD) vertices.push(x, y, nextX, nextY, corner, 0);
    });
  }
  return new Float32Array(vertices);
}

/** @param {WebGL2RenderingContext} gl @param {boolean} marked whether the things have a mark at the front */
export function makeShapes(gl, marked) {
  const filled = makeProgram(gl, VERTEX, FRAGMENT),
    { at } = filled;
  /** Whether there are things that the graphics processor does not have yet. */
  let fresh = false;
  /** @type {Map<string, Mesh>} by outline */
  const meshes = new Map();
  /** By the outline itself: robots of a kind share one. @type {WeakMap<Outline, Mesh>} */
  const meshOf = new WeakMap();

  /** @param {Mesh} mesh */
  function grow(mesh) {
    const old = mesh.words;
    mesh.floats = new Float32Array(Math.max(16, 2 * mesh.count) * WORDS);
    mesh.words = new Uint32Array(mesh.floats.buffer);
    mesh.words.set(old);
    gl.bindVertexArray(mesh.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, mesh.instances);
    gl.bufferData(gl.ARRAY_BUFFER, mesh.floats.byteLength, gl.DYNAMIC_DRAW);
    const bytes = { size: 4, type: gl.UNSIGNED_BYTE, normalized: true };
    setAttributes(
      gl,
      [
        { place: 2, size: 3, offset: 0 },
        { place: 3, ...bytes, offset: 12 },
        { place: 4, ...bytes, offset: 16 },
        { place: 5, size: 1, offset: 20 },
        { place: 6, size: 3, offset: 24 },
      ],
      4 * WORDS,
      1,
    );
  }

  return {
    /** @param {Outline} outline @returns {Mesh} */
    meshFor(outline) {
      let mesh = meshOf.get(outline);
      if (!mesh) meshOf.set(outline, (mesh = this.meshOfEqual(outline)));
      return mesh;
    },

    /** @param {Outline} outline @returns {Mesh} */
    meshOfEqual(outline) {
      const key = JSON.stringify(outline),
        known = meshes.get(key);
      if (known) return known;
      const vertices = verticesOf(outline, marked),
        array = gl.createVertexArray(),
        instances = gl.createBuffer();
      gl.bindVertexArray(array);
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, vertices, gl.STATIC_DRAW);
      setAttributes(
        gl,
        [
          { place: 0, size: 4, offset: 0 },
          { place: 1, size: 2, offset: 16 },
        ],
        24,
        0,
      );
      const mesh = {
        radius: radiusOf(outline),
        reach: reachOf(outline),
        vertices: vertices.length / 6,
        array,
        instances,
        floats: new Float32Array(0),
        words: new Uint32Array(0),
        count: 0,
      };
      meshes.set(key, mesh);
      return mesh;
    },

    clear() {
      for (const mesh of meshes.values()) mesh.count = 0;
      fresh = true;
    },

    /** @param {Mesh} mesh
     * @param {number} x
     * @param {number} y
     * @param {number} yaw in map
     * @param {number} fill packed
     * @param {number} edge packed
     * @param {boolean} bold
     * @param {number} [dx]
     * @param {number} [dy]
     * @param {number} [dyaw] the way to this pose */
    add(mesh, x, y, yaw, fill, edge, bold, dx = 0, dy = 0, dyaw = 0) {
      if ((mesh.count + 1) * WORDS > mesh.floats.length) grow(mesh);
      const place = mesh.count++ * WORDS;
      mesh.floats[place] = x;
      mesh.floats[place + 1] = y;
      mesh.floats[place + 2] = yaw;
      mesh.words[place + 3] = fill;
      mesh.words[place + 4] = edge;
      mesh.floats[place + 5] = bold ? 1 : 0;
      mesh.floats[place + 6] = dx;
      mesh.floats[place + 7] = dy;
      mesh.floats[place + 8] = dyaw;
    },

    /** @param {Float32Array} camera
     * @param {number} scale CSS pixels a metre
     * @param {number} ratio device pixels a CSS pixel
     * @param {number} least radius in CSS pixels
     * @param {number} [left] share of the ways that is left */
    draw(camera, scale, ratio, least, left = 0) {
      if (useProgram(gl, filled, camera)) {
        gl.uniform2f(at.pixels, gl.drawingBufferWidth, gl.drawingBufferHeight);
        gl.uniform2f(at.widths, 1.25 * ratio, 3 * ratio);
      }
      gl.uniform1f(at.left, left);
      for (const mesh of meshes.values()) {
        if (!mesh.count) continue;
        gl.uniform1f(at.grow, Math.max(1, least / (scale * mesh.radius)));
        gl.bindVertexArray(mesh.array);
        if (fresh) {
          gl.bindBuffer(gl.ARRAY_BUFFER, mesh.instances);
          gl.bufferSubData(gl.ARRAY_BUFFER, 0, mesh.floats, 0, WORDS * mesh.count);
        }
        gl.drawArraysInstanced(gl.TRIANGLES, 0, mesh.vertices, mesh.count);
      }
      fresh = false;
    },
  };
}
