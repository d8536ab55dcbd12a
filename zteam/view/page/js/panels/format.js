// Numbers as text, with their units. All are SI.

/**
 * Seconds of a clock: `12.3 s`, `4:05.0`, `1:02:03.0`.
 *
 * @param {number} seconds
 */
export function formatClock(seconds) {
  if (!Number.isFinite(seconds)) return "–";
  if (seconds < 60) return `${seconds.toFixed(1)} s`;
  const tenths = Math.floor(seconds * 10);
  const hours = Math.floor(tenths / 36000);
  const minutes = Math.floor(tenths / 600) % 60;
  const rest = ((tenths % 600) / 10).toFixed(1).padStart(4, "0");
  return hours ? `${hours}:${String(minutes).padStart(2, "0")}:${rest}` : `${minutes}:${rest}`;
}

const HOST_TIME = 1e8; // s: more is a time of the host's clock, not of a simulation's

/**
 * When a line was logged: the host's time of day, or seconds of simulated time.
 *
 * @param {number} seconds
 */
export function formatTime(seconds) {
  if (seconds < HOST_TIME) return formatNumber(seconds, 2);
  const date = new Date(1000 * seconds);
  const parts = [date.getHours(), date.getMinutes(), date.getSeconds()].map((part) => String(part).padStart(2, "0"));
  return `${parts.join(":")}.${String(Math.floor(date.getMilliseconds() / 10)).padStart(2, "0")}`;
}

/**
 * A number with a fixed count of decimals, or a dash.
 *
 * @param {number | null | undefined} value
 * @param {number} decimals
 * @param {string} [unit]
 */
export function formatNumber(value, decimals, unit = "") {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = value.toFixed(decimals);
  // A zero has no sign.
  const plain = Number(text) === 0 ? text.replace("-", "") : text;
  return unit ? `${plain} ${unit}` : plain;
}

/**
 * A number as it came, in at most seven digits.
 *
 * @param {number} value
 */
export function formatPlain(value) {
  return Number.isInteger(value) ? String(value) : String(Number(value.toPrecision(7)));
}

/**
 * How old something is: `0.1 s`, `12 s`, `3 min`.
 *
 * @param {number | null | undefined} seconds
 */
export function formatAge(seconds) {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return "–";
  // A stamp may be a moment ahead.
  if (seconds < 10) return formatNumber(Math.max(0, seconds), 1, "s");
  return seconds < 120 ? `${Math.round(seconds)} s` : `${Math.round(seconds / 60)} min`;
}

// The unit of a numeric field, by the end of its path (REP 103). The first row that fits decides.
/** @type {[RegExp, string][]} */
const UNITS = [
  [/covariance/, ""],
  [/(^|\.)(position|translation|point|origin\.position)\.[xyz]$/, "m"],
  [/(^|\.)points?(\[\d+\])?\.[xyz]$/, "m"],
  [/(^|\.)(orientation|rotation)\.[xyzw]$/, ""],
  [/(^|\.)linear_acceleration\.[xyz]$/, "m/s²"],
  [/(^|\.)linear\.[xyz]$/, "m/s"],
  [/(^|\.)(angular|angular_velocity)\.[xyz]$/, "rad/s"],
  [/(^|\.)(ranges\[\d+\]|min\(ranges\)|range|min_range|max_range|range_min|range_max)$/, "m"],
  [/(^|\.)(angle_min|angle_max|angle_increment|field_of_view|theta|yaw)$/, "rad"],
  [/(^|\.)(scan_time|time_increment|sec|age)$/, "s"],
  [/(^|\.)nanosec$/, "ns"],
  [/(^|\.)(speed|max_speed)$/, "m/s"],
  [/(^|\.)resolution$/, "m"],
];

/**
 * The unit of a field of a message, or "" where it is unknown or has none.
 *
 * @param {string} field a path such as `twist.twist.linear.x`
 */
export function unitOf(field) {
  return UNITS.find(([pattern]) => pattern.test(field))?.[1] ?? "";
}
