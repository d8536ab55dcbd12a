/** What held keys, a stick and a gamepad command. Pure. The keys are those of teleop_twist_keyboard and the arrows. */

/**
 * @typedef {{linear: number, left: number, angular: number}} Shares of the speed forwards and to the left, and of the
 *   turn rate
 */
/**
 * @typedef {{linear: number, left: number, angular: number}} Command m/s forwards and to the left, rad/s to the left
 */

/** @type {Record<string, [number, number, number]>} forward, left, turn */
const DIRECTIONS = {
  u: [1, 0, 1],
  i: [1, 0, 0],
  o: [1, 0, -1],
  j: [0, 0, 1],
  l: [0, 0, -1],
  m: [-1, 0, -1],
  ",": [-1, 0, 0],
  ".": [-1, 0, 1],
  U: [1, 1, 0],
  I: [1, 0, 0],
  O: [1, -1, 0],
  J: [0, 1, 0],
  L: [0, -1, 0],
  M: [-1, 1, 0],
  "<": [-1, 0, 0],
  ">": [-1, -1, 0],
  ArrowUp: [1, 0, 0],
  ArrowDown: [-1, 0, 0],
  ArrowLeft: [0, 0, 1],
  ArrowRight: [0, 0, -1],
};

/** By what a key multiplies speed and turn rate. @type {Record<string, [number, number]>} */
const FACTORS = { q: [1.1, 1.1], z: [0.9, 0.9], w: [1.1, 1], x: [0.9, 1], e: [1, 1.1], c: [1, 0.9] };

export const MIN_SPEED = 0.01;
export const MAX_SPEED = 10;
/** A stick that is less far out than this stands in the middle. */
const DEAD_ZONE = 0.12;

/** @param {string} key as KeyboardEvent.key */
export function isDirection(key) {
  return key in DIRECTIONS;
}

/** @param {string} key */
export function isFactor(key) {
  return key in FACTORS;
}

/** @param {{speed: number, turn: number}} limits @param {string} key @returns {{speed: number, turn: number}} */
export function scaled({ speed, turn }, key) {
  const [bySpeed, byTurn] = FACTORS[key] ?? [1, 1];
  return { speed: clamp(speed * bySpeed, MIN_SPEED, MAX_SPEED), turn: clamp(turn * byTurn, MIN_SPEED, MAX_SPEED) };
}

/** Several held keys add up: up and left drive an arc. @param {Iterable<string>} keys @returns {Shares} */
export function sharesOfKeys(keys) {
  let linear = 0,
    left = 0,
    angular = 0;
  for (const key of keys) {
    const [forward, sideways, turn] = DIRECTIONS[key] ?? [0, 0, 0];
    linear += forward;
    left += sideways;
    angular += turn;
  }
  return { linear: clamp(linear, -1, 1), left: clamp(left, -1, 1), angular: clamp(angular, -1, 1) };
}

/** @param {number} right -1..1 @param {number} down -1..1 of a stick @returns {Shares} */
export function sharesOfStick(right, down) {
  const out = Math.min(1, Math.hypot(right, down));
  if (out < DEAD_ZONE) return { linear: 0, left: 0, angular: 0 };
  const share = (out - DEAD_ZONE) / (1 - DEAD_ZONE),
    angle = Math.atan2(down, right);
  const linear = -Math.sin(angle) * share,
    angular = -Math.cos(angle) * share;
  // Without this a robot that drives back would turn to the other side than the stick points.
  return { linear, left: 0, angular: linear < -0.05 ? -angular : angular };
}

/** @param {Shares} shares @param {{speed: number, turn: number}} limits @returns {Command} */
export function commandOf(shares, { speed, turn }) {
  return { linear: shares.linear * speed, left: shares.left * speed, angular: shares.angular * turn };
}

/** @param {Shares} shares */
export function isZero({ linear, left, angular }) {
  return linear === 0 && left === 0 && angular === 0;
}

/** @param {number} value @param {number} low @param {number} high */
function clamp(value, low, high) {
  return Math.min(Math.max(value, low), high);
}
