/**
 * Where the view looks. The map lies in metres, x to the right and y up at angle 0; the screen in CSS pixels, y down.
 */

/** @typedef {{x: number, y: number, scale: number, angle: number}} View
 *  the point of the map at the middle of the screen, pixels a metre, and by how much the map is turned to the left */

export const MIN_SCALE = 0.2;
export const MAX_SCALE = 5000;

/** Holds a View; says "camera" by the function it got when that changes. */
export class Camera {
  /** @param {() => void} changed */
  constructor(changed) {
    this.changed = changed;
    this.x = 0;
    this.y = 0;
    this.scale = 40;
    this.angle = 0;
    /** Size of the screen in CSS pixels. */
    this.width = 1;
    this.height = 1;
    /** The robot in the middle; -1: none. */
    this.follow = -1;
    /** Whether the user, a URL or a layout has placed the camera: if not, it keeps the team in view. */
    this.placed = false;
    /** Whether something on the map is pressed: then the map stands still under it. */
    this.held = false;
    this.#turn();
  }

  #cos = 1;
  #sin = 0;
  /** Both are made once for each place of the camera. @type {Float32Array | null} */
  #matrix = null;
  /** @type {[number, number, number, number] | null} */
  #viewport = null;

  #moved() {
    this.#matrix = this.#viewport = null;
    this.changed();
  }

  #turn() {
    this.#cos = Math.cos(this.angle);
    this.#sin = Math.sin(this.angle);
  }

  /** @param {Partial<View> & {follow?: number}} view */
  set(view) {
    this.placed = true;
    this.show(view);
  }

  /** The same, but the team is still kept in view if it was. @param {Partial<View> & {follow?: number}} view */
  show(view) {
    Object.assign(this, view);
    this.scale = Math.min(Math.max(this.scale, MIN_SCALE), MAX_SCALE);
    this.#turn();
    this.#moved();
  }

  /** @returns {View & {follow: number}} */
  get() {
    return { x: this.x, y: this.y, scale: this.scale, angle: this.angle, follow: this.follow };
  }

  /** @param {number} width @param {number} height CSS pixels */
  resize(width, height) {
    this.width = Math.max(width, 1);
    this.height = Math.max(height, 1);
    this.#moved();
  }

  /** @param {number} x @param {number} y in map @returns {[number, number]} pixels */
  toScreen(x, y) {
    const dx = (x - this.x) * this.scale,
      dy = (y - this.y) * this.scale;
    return [this.width / 2 + this.#cos * dx - this.#sin * dy, this.height / 2 - this.#sin * dx - this.#cos * dy];
  }

  /** @param {number} px @param {number} py pixels @returns {[number, number]} in map */
  toMap(px, py) {
    const dx = (px - this.width / 2) / this.scale,
      dy = (this.height / 2 - py) / this.scale;
    return [this.x + this.#cos * dx + this.#sin * dy, this.y - this.#sin * dx + this.#cos * dy];
  }

  /** @param {number} dx @param {number} dy pixels that the map moves by on the screen */
  pan(dx, dy) {
    const [x, y] = this.toMap(this.width / 2 - dx, this.height / 2 - dy);
    this.set({ x, y, follow: -1 });
  }

  /**
   * Zoom and turn about a point of the screen, which keeps its place in the map; or about the robot that is followed.
   * @param {number} px @param {number} py @param {number} factor @param {number} [turn] radians to the left
   */
  zoom(px, py, factor, turn = 0) {
    if (this.follow >= 0) [px, py] = [this.width / 2, this.height / 2];
    const [x, y] = this.toMap(px, py);
    this.set({ scale: this.scale * factor, angle: normalize(this.angle + turn) });
    const [newX, newY] = this.toMap(px, py);
    this.set({ x: this.x + x - newX, y: this.y + y - newY });
  }

  /** @param {[number, number, number, number]} box xmin, ymin, xmax, ymax in map @param {number} [margin] pixels */
  fit([xmin, ymin, xmax, ymax], margin = 24) {
    const w = Math.max(xmax - xmin, 0.5),
      h = Math.max(ymax - ymin, 0.5);
    const c = Math.abs(this.#cos),
      s = Math.abs(this.#sin);
    const across = Math.max(this.width - 2 * margin, 50),
      down = Math.max(this.height - 2 * margin, 50);
    const scale = Math.min(across / (w * c + h * s), down / (w * s + h * c));
    this.set({ x: (xmin + xmax) / 2, y: (ymin + ymax) / 2, scale, follow: -1 });
  }

  /** @returns {[number, number, number, number]} the box in map around all that is on the screen; not to be changed */
  viewport() {
    return (this.#viewport ??= this.#box());
  }

  /** @returns {[number, number, number, number]} */
  #box() {
    const corners = [
      [0, 0],
      [this.width, 0],
      [0, this.height],
      [this.width, this.height],
    ];
    const points = corners.map(([px, py]) => this.toMap(px, py));
    const xs = points.map((p) => p[0]),
      ys = points.map((p) => p[1]);
    return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
  }

  /** @returns {Float32Array} 3 x 3, column by column: clip coordinates of WebGL from map. The same one until the camera
   *   moves or the screen gets another size */
  matrix() {
    return (this.#matrix ??= this.#compose());
  }

  #compose() {
    const sx = (2 * this.scale) / this.width,
      sy = (2 * this.scale) / this.height;
    const c = this.#cos,
      s = this.#sin;
    return new Float32Array([
      sx * c,
      sy * s,
      0,
      -sx * s,
      sy * c,
      0,
      -sx * (c * this.x - s * this.y),
      -sy * (s * this.x + c * this.y),
      1,
    ]);
  }
}

/** @param {number} angle @returns {number} in (-pi, pi] */
export function normalize(angle) {
  return Math.atan2(Math.sin(angle), Math.cos(angle));
}
