/** Costs above the map. Where several costmaps lie over each other the highest cost counts: drawn one above the other they
 *  would hide map and robots. */

import { makeProgram, setFilter, setOpacity, useProgram } from "./gl.js";

const VERTEX = `
void main() { gl_Position = vec4(2.0 * vec2(gl_VertexID & 1, gl_VertexID >> 1) - 1.0, 0.0, 1.0); }`;

// The colours of rviz: from blue to red, the inscribed radius in cyan, lethal cells in magenta.
const FRAGMENT = `
uniform sampler2D costs;
out vec4 color;
void main() {
  float cost = texelFetch(costs, ivec2(gl_FragCoord.xy), 0).r;
  if (cost < 0.005) discard;
  color = vec4(cost, 0.0, 1.0 - cost, 1.0);
  if (cost > 0.995) color.rgb = vec3(1.0, 0.0, 1.0);
  else if (cost > 0.985) color.rgb = vec3(0.0, 1.0, 1.0);
}`;

/** @param {WebGL2RenderingContext} gl */
export function makeCostmaps(gl) {
  const program = makeProgram(gl, VERTEX, FRAGMENT);
  const costs = gl.createTexture(),
    buffer = gl.createFramebuffer(),
    empty = gl.createVertexArray();
  let width = 0,
    height = 0;

  function resize() {
    gl.bindTexture(gl.TEXTURE_2D, costs);
    if (width === gl.drawingBufferWidth && height === gl.drawingBufferHeight) return;
    [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, width, height, 0, gl.RED, gl.UNSIGNED_BYTE, null);
    setFilter(gl, gl.NEAREST);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, costs, 0);
  }

  return {
    /**
     * @param {Float32Array} camera
     * @param {number} opacity 0 to 1
     * @param {() => void} drawCells draws the costs, 0 to 1, as red
     */
    draw(camera, opacity, drawCells) {
      gl.bindFramebuffer(gl.FRAMEBUFFER, buffer);
      resize();
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT);
      gl.blendEquation(gl.MAX);
      setOpacity(gl, 1);
      drawCells();
      gl.blendEquation(gl.FUNC_ADD);
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
      setOpacity(gl, opacity);
      useProgram(gl, program, camera);
      gl.bindVertexArray(empty);
      gl.bindTexture(gl.TEXTURE_2D, costs);
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    },
  };
}
