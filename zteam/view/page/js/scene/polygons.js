/** Outlines: triangles for filling them, their size. Pure. */

/** @typedef {[number, number][]} Polygon */

/**
 * Ear clipping (Meisters 1975): any simple polygon, either way round.
 * @param {Polygon} polygon @returns {number[]} x, y of three corners a triangle
 */
export function triangulate(polygon) {
  const left = polygon.map((_, i) => i);
  if (signedArea(polygon) < 0) left.reverse();
  /** @type {number[]} */
  const corners = [];
  let misses = 0;
  for (let i = 0; left.length > 2 && misses <= left.length; i++) {
    const n = left.length,
      [a, b, c] = [left[i % n], left[(i + 1) % n], left[(i + 2) % n]];
    if (isEar(polygon, left, a, b, c)) {
      corners.push(...polygon[a], ...polygon[b], ...polygon[c]);
      left.splice((i + 1) % n, 1);
      misses = 0;
    } else misses++;
  }
  return corners;
}

/** @param {Polygon} polygon @param {number[]} left @param {number} a @param {number} b @param {number} c */
function isEar(polygon, left, a, b, c) {
  const [p, q, r] = [polygon[a], polygon[b], polygon[c]];
  if (cross(p, q, r) <= 0) return false;
  return !left.some(
    (i) =>
      i !== a &&
      i !== b &&
      i !== c &&
      cross(p, q, polygon[i]) >= 0 &&
      cross(q, r, polygon[i]) >= 0 &&
      cross(r, p, polygon[i]) >= 0,
  );
}

/** @param {[number, number]} a @param {[number, number]} b @param {[number, number]} c */
function cross(a, b, c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/** @param {Polygon} polygon */
function signedArea(polygon) {
  let area = 0;
  for (let i = 0; i < polygon.length; i++) {
    const [x, y] = polygon[i],
      [nextX, nextY] = polygon[(i + 1) % polygon.length];
    area += x * nextY - nextX * y;
  }
  return area / 2;
}

/** The largest distance of a corner from the origin. @param {Polygon[]} outline */
export function radiusOf(outline) {
  return Math.max(0.05, ...outline.flat().map(([x, y]) => Math.hypot(x, y)));
}

/** How far the outline reaches, as the mean of all directions: a name at this distance touches it however it is turned.
 * @param {Polygon[]} outline */
export function reachOf(outline) {
  const corners = outline.flat(),
    directions = circle(1, 16);
  const reaches = directions.map(([c, s]) => Math.max(0.03, ...corners.map(([x, y]) => c * x + s * y)));
  return reaches.reduce((sum, reach) => sum + reach) / directions.length;
}

/** How far the outline reaches to the front. @param {Polygon[]} outline */
export function frontOf(outline) {
  return Math.max(0.05, ...outline.flat().map(([x]) => x));
}

/** @param {number} radius @param {number} [corners] @returns {Polygon} a circle */
export function circle(radius, corners = 20) {
  return Array.from({ length: corners }, (_, i) => [
    radius * Math.cos((2 * Math.PI * i) / corners),
    radius * Math.sin((2 * Math.PI * i) / corners),
  ]);
}
