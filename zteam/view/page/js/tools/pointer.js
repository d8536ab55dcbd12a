/** Mouse and touch on the map: the camera, and the tool that is in use. */

import { MIN_RADIUS } from "../scene/bodies.js";

/** Robots are hit this much beside them, in pixels. */
const REACH = 6;
const ZOOM_STEP = 1.0015;
const TURN_STEP = 0.002;

/** @typedef {import("./pose.js").Point} Point */
/** @typedef {{down(point: Point): boolean | void, move(point: Point): void, up(point: Point): void, cancel(): void,
 * paint(pen: import("../scene/paint.js").Pen): void, wheel?(steps: number): boolean, hover?(point: Point | null): void}} Tool
 *   `down` returns false if the press is not for the tool: then it moves the map */

/**
 * The robot at a place of the screen; -1: none.
 * @param {import("../app.js").App} app
 * @param {number} px
 * @param {number} py
 */
export function robotAt({ store, camera, scene }, px, py) {
  let found = -1,
    nearest = Infinity;
  const { poses } = store;
  for (let i = 0; i < poses.count; i++) {
    const [x, y] = camera.toScreen(...poses.drawnAt(i)),
      distance = Math.hypot(px - x, py - y);
    if (distance >= nearest) continue;
    const radius = Math.max(MIN_RADIUS, (scene?.radius(poses.ids[i]) ?? 0) * camera.scale);
    if (distance <= radius + REACH) [found, nearest] = [poses.ids[i], distance];
  }
  return found;
}

/**
 * @param {import("../app.js").App} app @param {HTMLElement} element @param {() => Tool} tool the one in use
 */
export function listenToPointer(app, element, tool) {
  /** @type {Map<number, {px: number, py: number}>} fingers on the screen */
  const fingers = new Map();
  /** @type {{id: number, does: "tool" | "pan" | "turn", px: number, py: number, using: Tool} | null} */
  let press = null;

  /** @param {MouseEvent} event @returns {Point} */
  function pointOf(event) {
    const box = element.getBoundingClientRect(),
      px = event.clientX - box.left,
      py = event.clientY - box.top;
    const [x, y] = app.camera.toMap(px, py);
    return { px, py, x, y, shift: event.shiftKey, robot: robotAt(app, px, py) };
  }

  /** @param {PointerEvent} event */
  function down(event) {
    if (event.target instanceof Element && event.target.closest("[data-own-pointer]")) return;
    element.setPointerCapture(event.pointerId);
    const point = pointOf(event);
    if (event.pointerType === "touch") {
      fingers.set(event.pointerId, point);
      if (fingers.size > 1) return void cancel();
    } else if (press) return;
    const using = tool();
    const taken = event.button === 0 && using.down(point) !== false;
    const does = taken ? "tool" : event.button === 2 ? "turn" : "pan";
    press = { id: event.pointerId, does, px: point.px, py: point.py, using };
    app.camera.held = true;
    app.scene?.requestDraw();
  }

  /** @param {PointerEvent} event */
  function move(event) {
    if (fingers.size > 1) return gesture(event);
    if (!press) return hover(event);
    if (press.id !== event.pointerId) return;
    const point = pointOf(event);
    if (press.does === "tool") press.using.move(point);
    else if (press.does === "pan") app.camera.pan(point.px - press.px, point.py - press.py);
    else app.camera.zoom(element.clientWidth / 2, element.clientHeight / 2, 1, turnAbout(press, point));
    [press.px, press.py] = [point.px, point.py];
    app.scene?.requestDraw();
  }

  /** The pointer moves without a press, or leaves. @param {PointerEvent} event */
  function hover(event) {
    const using = tool(),
      outside = event.type === "pointerleave" || (event.target instanceof Element && event.target.closest("[data-own-pointer]"));
    if (!using.hover) return;
    using.hover(outside ? null : pointOf(event));
    app.scene?.requestDraw();
  }

  /** @param {{px: number, py: number}} from @param {{px: number, py: number}} to */
  function turnAbout(from, to) {
    const cx = element.clientWidth / 2,
      cy = element.clientHeight / 2;
    return Math.atan2(from.py - cy, from.px - cx) - Math.atan2(to.py - cy, to.px - cx);
  }

  /** Two fingers move, zoom and turn the map. @param {PointerEvent} event */
  function gesture(event) {
    const finger = fingers.get(event.pointerId);
    if (!finger) return;
    const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
    const { px, py } = pointOf(event);
    if (other) {
      const before = Math.hypot(finger.px - other.px, finger.py - other.py),
        after = Math.hypot(px - other.px, py - other.py);
      const turn = Math.atan2(finger.py - other.py, finger.px - other.px) - Math.atan2(py - other.py, px - other.px);
      app.camera.zoom(other.px, other.py, after / Math.max(before, 1), turn);
    }
    [finger.px, finger.py] = [px, py];
  }

  /** @param {PointerEvent} event */
  function up(event) {
    fingers.delete(event.pointerId);
    if (press?.id !== event.pointerId) return;
    if (press.does === "tool") {
      const point = pointOf(event);
      press.using.move(point);
      press.using.up(point);
    }
    press = null;
    app.camera.held = false;
    app.scene?.requestDraw();
  }

  /** @returns {boolean} whether there was a press to cancel */
  function cancel() {
    const had = press !== null;
    if (press?.does === "tool") press.using.cancel();
    press = null;
    app.camera.held = false;
    app.scene?.requestDraw();
    return had;
  }

  /** @param {WheelEvent} event */
  function wheel(event) {
    event.preventDefault();
    const pixels = (event.deltaY || event.deltaX) * [1, 16, 100][event.deltaMode];
    if (press?.does === "tool" && press.using.wheel?.(-Math.sign(pixels))) return app.scene?.requestDraw();
    const { px, py } = pointOf(event);
    if (event.shiftKey) app.camera.zoom(px, py, 1, -TURN_STEP * pixels);
    else app.camera.zoom(px, py, ZOOM_STEP ** (-pixels * (event.ctrlKey ? 5 : 1)));
  }

  element.addEventListener("pointerdown", down);
  // A press takes the focus away from fields and lists, and does not give it to the map: arrows move the map then.
  element.addEventListener("mousedown", (event) => {
    if (event.target instanceof Element && event.target.closest("[data-own-pointer]")) return;
    event.preventDefault();
    if (document.activeElement instanceof HTMLElement) document.activeElement.blur();
  });
  element.addEventListener("pointermove", move);
  element.addEventListener("pointerleave", hover);
  element.addEventListener("pointerup", up);
  element.addEventListener("pointercancel", (event) => {
    fingers.delete(event.pointerId);
    cancel();
  });
  element.addEventListener("wheel", wheel, { passive: false });
  element.addEventListener("contextmenu", (event) => event.preventDefault());
  return { cancel };
}
