/** The TF tree as axes with names. */

import { ahead, isFree, isOnScreen, label, spriteOf } from "./paint.js";

/** @typedef {{name: string, parent: string, x: number, y: number, yaw: number}} Frame pose in the parent */

/** With more places on the screen only the axes are drawn. */
const MAX_NAMED = 150;
/** Frames within so many pixels have their names together. */
const NEAR = 24;
const LINE = 14;
const X_COLOR = "#d55e00",
  Y_COLOR = "#009e73";

/**
 * Poses of all frames in the root of their tree. Frames of a loop are left out.
 * @param {Frame[]} frames @param {string} [root] the frames of other trees are left out
 * @returns {Map<string, {x: number, y: number, yaw: number}>}
 */
export function composeFrames(frames, root = "map") {
  /** @type {Map<string, {x: number, y: number, yaw: number} | null>} */
  const poses = new Map([[root, { x: 0, y: 0, yaw: 0 }]]);
  const byName = new Map(frames.map((frame) => [frame.name, frame]));
  /** @param {string} name @returns {{x: number, y: number, yaw: number} | null} */
  function poseOf(name) {
    const known = poses.get(name);
    if (known !== undefined) return known;
    poses.set(name, null);
    const frame = byName.get(name),
      parent = frame && poseOf(frame.parent);
    if (!frame || !parent) return null;
    const c = Math.cos(parent.yaw),
      s = Math.sin(parent.yaw);
    const pose = {
      x: parent.x + c * frame.x - s * frame.y,
      y: parent.y + s * frame.x + c * frame.y,
      yaw: parent.yaw + frame.yaw,
    };
    poses.set(name, pose);
    return pose;
  }
  for (const frame of frames) poseOf(frame.name);
  return /** @type {any} */ (new Map([...poses].filter(([, pose]) => pose)));
}

/** The newest ones: they come less often than pictures.
 * @type {{frames: Frame[] | null, poses: ReturnType<typeof composeFrames>}} */
const composed = { frames: null, poses: new Map() };

/** @param {import("./paint.js").Pen} pen */
export function paintFrames(pen) {
  const { app, ctx } = pen,
    frames = app.store.docs.tf?.frames;
  if (!frames) return;
  ctx.lineWidth = 2;
  const length = Math.min(34, Math.max(12, 0.35 * app.camera.scale));
  /** @type {Map<string, {px: number, py: number, names: string[]}>} by place on the screen */
  const places = new Map();
  if (frames !== composed.frames) Object.assign(composed, { frames, poses: composeFrames(frames) });
  for (const [name, { x, y, yaw }] of composed.poses) {
    const [px, py] = app.camera.toScreen(x, y);
    if (!isOnScreen(app, px, py)) continue;
    for (const [color, turn] of /** @type {[string, number][]} */ ([
      [X_COLOR, 0],
      [Y_COLOR, Math.PI / 2],
    ])) {
      ctx.strokeStyle = color;
      ctx.beginPath();
      ctx.moveTo(px, py);
      ctx.lineTo(...ahead(app, px, py, yaw + turn, length));
      ctx.stroke();
    }
    const key = `${Math.round(px / NEAR)},${Math.round(py / NEAR)}`,
      place = places.get(key);
    if (place) place.names.push(name);
    else places.set(key, { px, py, names: [name] });
  }
  if (places.size <= MAX_NAMED) for (const place of places.values()) paintNames(pen, place);
}

/** Names of frames in one place, below each other: to the right of it or to the left, lower or higher, or not at all.
 * @param {import("./paint.js").Pen} pen @param {{px: number, py: number, names: string[]}} place */
function paintNames(pen, { px, py, names }) {
  const width = Math.max(...names.map((name) => spriteOf(pen, name).width)),
    line = LINE * pen.theme.textSize,
    height = line * names.length;
  for (const [left, top] of [
    [px + 6, py + 4],
    [px + 6, py - 4 - height],
    [px - 6 - width, py + 4],
    [px - 6 - width, py - 4 - height],
  ]) {
    /** @type {import("./paint.js").Box} */
    const box = [left, top, left + width, top + height];
    if (!isFree(pen, box)) continue;
    pen.taken.push(box);
    return names.forEach((name, i) => label(pen, name, left, top + line * (i + 0.5), { align: "left" }));
  }
}
