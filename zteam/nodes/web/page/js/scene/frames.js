/** The TF tree as axes with names. */

import { ahead, isOnScreen, label } from "./paint.js";

/** @typedef {{name: string, parent: string, x: number, y: number, yaw: number}} Frame pose in the parent */

const MAX_NAMES = 200;
const X_COLOR = "#d55e00", Y_COLOR = "#009e73";

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
    const frame = byName.get(name), parent = frame && poseOf(frame.parent);
    if (!frame || !parent) return null;
    const c = Math.cos(parent.yaw), s = Math.sin(parent.yaw);
    const pose = { x: parent.x + c * frame.x - s * frame.y, y: parent.y + s * frame.x + c * frame.y, yaw: parent.yaw + frame.yaw };
    poses.set(name, pose);
    return pose;
  }
  for (const frame of frames) poseOf(frame.name);
  return /** @type {any} */ (new Map([...poses].filter(([, pose]) => pose)));
}

/** @param {import("./paint.js").Pen} pen */
export function paintFrames(pen) {
  const { app, ctx } = pen, frames = app.store.docs.tf?.frames;
  if (!frames) return;
  ctx.lineWidth = 2;
  const length = Math.min(34, Math.max(12, 0.35 * app.camera.scale));
  /** @type {[string, number, number][]} */
  const names = [];
  for (const [name, { x, y, yaw }] of composeFrames(frames)) {
    const [px, py] = app.camera.toScreen(x, y);
    if (!isOnScreen(app, px, py)) continue;
    for (const [color, turn] of /** @type {[string, number][]} */ ([[X_COLOR, 0], [Y_COLOR, Math.PI / 2]])) {
      ctx.strokeStyle = color;
      ctx.beginPath();
      ctx.moveTo(px, py);
      ctx.lineTo(...ahead(app, px, py, yaw + turn, length));
      ctx.stroke();
    }
    names.push([name, px, py]);
  }
  if (names.length > MAX_NAMES) return;
  // Frames in one place have their names below each other.
  const lines = new Map();
  for (const [name, px, py] of names) {
    const place = `${Math.round(px / 12)},${Math.round(py / 12)}`, line = lines.get(place) ?? 0;
    lines.set(place, line + 1);
    label(pen, name, px + 6, py + 9 + 14 * line, { align: "left" });
  }
}
