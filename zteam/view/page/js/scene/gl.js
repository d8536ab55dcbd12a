/** Small helpers for WebGL2. */

/**
 * @param {WebGL2RenderingContext} gl
 * @param {string} vertex
 * @param {string} fragment GLSL ES 3.00 without its version line, with a premultiplied colour as its one `out vec4`
 * @returns {{program: WebGLProgram, at: Record<string, WebGLUniformLocation | null>}} `at`: the uniforms by name
 */
export function makeProgram(gl, vertex, fragment) {
  const program = /** @type {WebGLProgram} */ (gl.createProgram());
  const paint = fragment.replace("void main()", "void paint()"),
    color = /out vec4 (\w+);/.exec(fragment)?.[1];
  for (const [type, source] of /** @type {[number, string][]} */ ([
    [gl.VERTEX_SHADER, vertex],
    [gl.FRAGMENT_SHADER, `${paint}\nuniform float opacity;\nvoid main() { paint(); ${color} *= opacity; }`],
  ])) {
    const shader = /** @type {WebGLShader} */ (gl.createShader(type));
    gl.shaderSource(
      shader,
      `#version 300 es\nprecision highp float;\nprecision highp int;\nprecision highp usampler2D;\n${source}`,
    );
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
      throw new Error(`${gl.getShaderInfoLog(shader)}`);
    }
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
    throw new Error(`${gl.getProgramInfoLog(program)}`);
  }
  /** @type {Record<string, WebGLUniformLocation | null>} */
  const at = {};
  for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = /** @type {WebGLActiveInfo} */ (gl.getActiveUniform(program, i));
    at[name] = gl.getUniformLocation(program, name);
  }
  return { program, at };
}

/** @type {WeakMap<WebGLProgram, Float32Array>} */
const cameras = new WeakMap();
/** Of what is drawn from now on. @type {WeakMap<WebGL2RenderingContext, number>} */
const wanted = new WeakMap();
/** @type {WeakMap<WebGLProgram, number>} */
const opacities = new WeakMap();

/** Of all that programs draw from now on. @param {WebGL2RenderingContext} gl @param {number} opacity 0 to 1 */
export function setOpacity(gl, opacity) {
  wanted.set(gl, opacity);
}

/**
 * Makes a program the one that draws. Its uniforms stay from one drawing to the next.
 * @param {WebGL2RenderingContext} gl
 * @param {{program: WebGLProgram, at: Record<string, WebGLUniformLocation | null>}} program
 * @param {Float32Array} camera as `Camera.matrix` gives it
 * @returns {boolean} whether the camera has moved or the canvas got another size since the program's last drawing
 */
export function useProgram(gl, { program, at }, camera) {
  gl.useProgram(program);
  const opacity = wanted.get(gl) ?? 1;
  if (opacities.get(program) !== opacity) {
    opacities.set(program, opacity);
    gl.uniform1f(at.opacity, opacity);
  }
  if (cameras.get(program) === camera) return false;
  cameras.set(program, camera);
  gl.uniformMatrix3fv(at.camera, false, camera);
  return true;
}

/** @typedef {{place: number, size: number, type?: number, normalized?: boolean, offset: number}} Attribute
 *  place: layout location; size: components; type: gl.FLOAT unless told; offset: bytes */

/**
 * Attributes of the buffer that is bound now.
 * @param {WebGL2RenderingContext} gl @param {Attribute[]} attributes @param {number} stride bytes
 * @param {number} divisor 1: one item an instance
 */
export function setAttributes(gl, attributes, stride, divisor) {
  for (const { place, size, type = gl.FLOAT, normalized = false, offset } of attributes) {
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, type, normalized, stride, offset);
    gl.vertexAttribDivisor(place, divisor);
  }
}

/**
 * @param {WebGL2RenderingContext} gl @param {number} filter of the texture that is bound now, for both directions
 */
export function setFilter(gl, filter) {
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, filter);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, filter);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
}
