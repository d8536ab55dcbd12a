/** A cursor for the tools, moved by keys while the map has the focus: the keyboard's mouse. */

import { label, strokeWithHalo } from "../scene/paint.js";
import { robotAt } from "./pointer.js";

/** Pixels of one arrow key, and with Shift. */
const STEP = 16;
const FINE = 2;
/** The map scrolls when the cursor would come nearer to its border than this, in pixels. */
const BORDER = 24;
/** Pixels from the middle of the cross to its ends. */
const INNER = 4;
const OUTER = 13;
const ARROWS = /** @type {Record<string, [number, number]>} */ ({
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
});
const TURNS = /** @type {Record<string, number>} */ ({ "[": 1, "]": -1 });
/** Tools that do nothing at a single place: Enter presses and the next Enter releases. */
const DRAGGED = new Set(["move", "measure"]);

/**
 * @param {import("../app.js").App} app @param {HTMLElement} map what takes the focus @param {HTMLElement} said tells
 *   screen readers where the cursor is
 * @param {() => import("./pointer.js").Tool} tool the one in use
 */
export function makeCursor(app, map, said, tool) {
  const { camera } = app;
  /** Where it is, in map; null while the map has no focus. @type {[number, number] | null} */
  let at = null;
  /** Where it was when the map lost the focus. @type {[number, number] | null} */
  let left = null;
  /** What Space or Enter has pressed. @type {import("./pointer.js").Tool | null} */
  let held = null;

  /** @param {[number, number]} place @returns {import("./pose.js").Point} */
  function pointAt([x, y]) {
    const [px, py] = camera.toScreen(x, y);
    return { px, py, x, y, shift: false, robot: robotAt(app, px, py) };
  }

  function say() {
    app.scene?.requestDraw();
    if (!at) return;
    const { robot } = pointAt(at);
    said.textContent = textOf(at) + (robot >= 0 ? `, ${app.store.robots.get(robot)?.name ?? `robot ${robot}`}` : "");
  }

  /** Onto the screen; the map goes along at its border. @param {number} px @param {number} py */
  function moveTo(px, py) {
    const inside = [px, py].map((value, i) => {
      const size = i ? camera.height : camera.width;
      return Math.min(Math.max(value, BORDER), Math.max(size - BORDER, BORDER));
    });
    const [dx, dy] = [inside[0] - px, inside[1] - py];
    at = camera.toMap(px, py);
    if (dx || dy) camera.pan(dx, dy);
    if (held) held.move(pointAt(at));
    else tool().hover?.(pointAt(at));
    say();
  }

  /** @param {[number, number]} place @param {string} key Enter or Space */
  function press(place, key) {
    const point = pointAt(place);
    if (held) {
      held.up(point);
      held = null;
      return;
    }
    const using = tool();
    if (using.down(point) === false) return;
    if (app.tool === "select" || (key === "Enter" && !DRAGGED.has(app.tool))) using.up(point);
    else held = using;
  }

  /** @returns {boolean} whether there was a press to cancel */
  function cancel() {
    const had = held !== null;
    held?.cancel();
    held = null;
    return had;
  }

  map.addEventListener("focus", () => {
    const [first] = app.store.selection,
      pose = first === undefined ? null : app.store.poses.at(first);
    const [px, py] = camera.toScreen(...(left ?? (pose ? [pose.x, pose.y] : [camera.x, camera.y])));
    const seen = px >= 0 && py >= 0 && px <= camera.width && py <= camera.height;
    moveTo(...(seen ? /** @type {[number, number]} */ ([px, py]) : /** @type {[number, number]} */ ([camera.width / 2, camera.height / 2])));
  });
  map.addEventListener("blur", () => {
    cancel();
    tool().hover?.(null);
    [left, at] = [at, null];
    app.scene?.requestDraw();
  });

  return {
    cancel,
    /** Pixels; null while the map has no focus. @returns {[number, number] | null} */
    place: () => at && camera.toScreen(...at),

    /** @param {KeyboardEvent} event @returns {boolean} whether it was for the cursor */
    key({ key, shiftKey, ctrlKey, repeat }) {
      if (!at || ctrlKey) return false;
      const arrow = ARROWS[key];
      if (arrow) {
        const [px, py] = camera.toScreen(...at),
          step = shiftKey ? FINE : STEP;
        moveTo(px + step * arrow[0], py + step * arrow[1]);
      } else if (key === "Enter" || key === " ") {
        if (!repeat) press(at, key);
      } else if (!(key in TURNS && held?.wheel?.(TURNS[key]))) return false;
      app.scene?.requestDraw();
      return true;
    },

    /** @param {import("../scene/paint.js").Pen} pen */
    paint(pen) {
      if (!at) return;
      const { ctx, theme } = pen,
        [px, py] = camera.toScreen(...at);
      ctx.beginPath();
      for (const [dx, dy] of Object.values(ARROWS)) {
        ctx.moveTo(px + INNER * dx, py + INNER * dy);
        ctx.lineTo(px + OUTER * dx, py + OUTER * dy);
      }
      strokeWithHalo(pen, theme.css.accent, 2);
      // Below is the name of a robot.
      label(pen, textOf(at), px, py - OUTER - 10 * theme.textSize);
    },
  };
}

/** @param {[number, number]} place in map @returns {string} metres */
function textOf([x, y]) {
  return `${x.toFixed(2)}, ${y.toFixed(2)} m`;
}
