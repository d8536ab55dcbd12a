/** Where all robots are, and how they are drawn between two ticks: on their way from the pose before to the newest one. */

/** A robot that moved faster than this was placed there (m/s, rad/s), as is one that is farther from its last pose while time stands. */
const MAX_SPEED = 3,
  MAX_TURN = 6;
const SLACK = 0.05;
/** Bounds of the time between two poses, in ms: a way takes no longer. */
const SHORTEST = 20,
  LONGEST = 1000;
const FIRST_PERIOD = 100;
const FIELDS = /** @type {const} */ (["ids", "x", "y", "yaw", "dx", "dy", "dyaw", "truth"]);

/** @typedef {{x: number, y: number, yaw: number}} Pose */

/**
 * Poses of all robots as arrays: the newest ones, and the way that a robot still has to go to its newest one. It is drawn
 * at `x - left * dx`.
 */
export class PoseTable {
  count = 0;
  ids = new Uint16Array(0);
  x = new Float32Array(0);
  y = new Float32Array(0);
  yaw = new Float32Array(0);
  dx = new Float32Array(0);
  dy = new Float32Array(0);
  dyaw = new Float32Array(0);
  /** 1: from the simulator's ground truth, because the robot has no transforms. */
  truth = new Uint8Array(0);
  /** The share of the way that is left in what is drawn now: 1 at the pose before, 0 at the newest. */
  left = 0;
  /** @type {Map<number, number>} place in the arrays by robot id */
  index = new Map();
  /** Of the newest poses: seconds of the team's clock, and ms at which they came. */
  #stamp = -1;
  #came = -Infinity;
  /** Mean ms between two poses. */
  period = FIRST_PERIOD;
  /** Whether a robot has a way to go. */
  #moves = false;

  clear() {
    this.count = this.left = 0;
    this.#stamp = -1;
    this.#moves = false;
    this.index.clear();
  }

  /**
   * @param {import("./wire.js").Poses} block all poses of a frame
   * @param {number} stamp s @param {number} now ms
   */
  take(block, stamp, now) {
    const count = block.ids.length;
    if (count > this.ids.length) this.#grow(count);
    let same = count === this.index.size;
    for (let i = 0; same && i < count; i++) same = this.ids[i] === block.ids[i];
    this.#begin(stamp, now);
    const values = { ...block, ...this.#ways(block, same) };
    this.ids.set(block.ids);
    for (const name of /** @type {const} */ (["x", "y", "yaw", "dx", "dy", "dyaw"])) this[name].set(values[name]);
    this.truth.fill(block.truth ? 1 : 0, 0, count);
    this.count = count;
    if (same) return;
    this.index.clear();
    for (let i = 0; i < count; i++) this.index.set(this.ids[i], i);
  }

  /** Seconds of the team's clock from the poses before; negative: time was set back, or nothing is known. */
  #passed = -1;

  /** @param {number} stamp s @param {number} now ms */
  #begin(stamp, now) {
    this.#passed = this.#stamp < 0 ? -1 : stamp - this.#stamp;
    this.#stamp = stamp;
    if (this.#passed !== 0) {
      const elapsed = now - this.#came;
      this.drawAt(now);
      if (elapsed < 2 * LONGEST) this.period += 0.3 * (Math.min(Math.max(elapsed, SHORTEST), LONGEST) - this.period);
      this.#came = now;
      this.#moves = false;
    }
  }

  /**
   * The ways from where the robots are drawn to their new poses.
   * @param {import("./wire.js").Poses} block
   * @param {boolean} same whether these are the robots of before
   */
  #ways({ ids, x, y, yaw }, same) {
    const [dx, dy, dyaw] = [new Float32Array(ids.length), new Float32Array(ids.length), new Float32Array(ids.length)],
      { left } = this;
    if (this.#passed < 0) return { dx, dy, dyaw };
    const farthest = MAX_SPEED * this.#passed + SLACK,
      widest = MAX_TURN * this.#passed + SLACK;
    for (let i = 0; i < ids.length; i++) {
      const k = same ? i : (this.index.get(ids[i]) ?? -1);
      if (k < 0) continue;
      if (this.#passed === 0) {
        // A robot was moved between two ticks: the others go their ways on.
        if (x[i] !== this.x[k] || y[i] !== this.y[k] || yaw[i] !== this.yaw[k]) continue;
        [dx[i], dy[i], dyaw[i]] = [this.dx[k], this.dy[k], this.dyaw[k]];
        continue;
      }
      const turn = yaw[i] - this.yaw[k],
        shortest = turn - 2 * Math.PI * Math.round(turn / (2 * Math.PI));
      if (Math.hypot(x[i] - this.x[k], y[i] - this.y[k]) > farthest || Math.abs(shortest) > widest) continue;
      dx[i] = x[i] - this.x[k] + left * this.dx[k];
      dy[i] = y[i] - this.y[k] + left * this.dy[k];
      dyaw[i] = shortest + left * this.dyaw[k];
      if (Math.abs(dx[i]) + Math.abs(dy[i]) + Math.abs(dyaw[i]) > 1e-4) this.#moves = true;
    }
    return { dx, dy, dyaw };
  }

  /** What is drawn from now on. @param {number} now ms @returns {boolean} whether that will change without new poses */
  drawAt(now) {
    this.left = this.#moves ? Math.max(0, 1 - Math.max(0, now - this.#came) / this.period) : 0;
    return this.left > 0;
  }

  /** The newest poses are drawn from now on: the world stands, or there is no time for pictures in between. */
  arrive() {
    this.left = 0;
    this.#moves = false;
  }

  /** @param {number} size */
  #grow(size) {
    for (const name of FIELDS) {
      const old = this[name],
        larger = new /** @type {any} */ (old.constructor)(2 * size);
      larger.set(old);
      /** @type {any} */ (this)[name] = larger;
    }
  }

  /** The newest pose. @param {number} id @returns {Pose & {truth: boolean} | null} */
  at(id) {
    const i = this.index.get(id);
    if (i === undefined) return null;
    return { x: this.x[i], y: this.y[i], yaw: this.yaw[i], truth: this.truth[i] === 1 };
  }

  /** Where a robot is drawn. @param {number} id @returns {Pose | null} */
  drawn(id) {
    const i = this.index.get(id);
    if (i === undefined) return null;
    const [x, y] = this.drawnAt(i);
    return { x, y, yaw: this.yaw[i] - this.left * this.dyaw[i] };
  }

  /** The same by its place in the arrays: x, y. @param {number} i @returns {[number, number]} */
  drawnAt(i) {
    return [this.x[i] - this.left * this.dx[i], this.y[i] - this.left * this.dy[i]];
  }
}
