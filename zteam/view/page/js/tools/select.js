/** Selecting: a click, Shift+click to add, Shift+drag for a box. A drag without Shift moves the map. */

/** A press that moves by fewer pixels is a click. */
const CLICK = 5;

/** @param {import("../app.js").App} app */
export function makeSelectTool(app) {
  /** @type {{start: import("./pose.js").Point, last: import("./pose.js").Point, moved: boolean} | null} */
  let press = null;

  /** The robots in the box. @returns {number[]} */
  function inBox() {
    if (!press) return [];
    const { start, last } = press,
      { poses } = app.store;
    const ids = [];
    for (let i = 0; i < poses.count; i++) {
      const [px, py] = app.camera.toScreen(...poses.drawnAt(i));
      if ((px - start.px) * (px - last.px) <= 0 && (py - start.py) * (py - last.py) <= 0) ids.push(poses.ids[i]);
    }
    return ids;
  }

  /** @param {import("./pose.js").Point} point */
  function click(point) {
    const chosen = new Set(point.shift ? app.store.selection : []);
    if (point.robot >= 0) {
      if (!chosen.delete(point.robot)) chosen.add(point.robot);
    }
    app.select(chosen);
  }

  return {
    /** @param {import("./pose.js").Point} point */
    down(point) {
      press = { start: point, last: point, moved: false };
    },
    /** @param {import("./pose.js").Point} point */
    move(point) {
      if (!press) return;
      const { start, last } = press;
      press.moved ||= Math.hypot(point.px - start.px, point.py - start.py) > CLICK;
      if (press.moved && !start.shift) app.camera.pan(point.px - last.px, point.py - last.py);
      press.last = point;
    },
    up() {
      if (press && !press.moved) click(press.start);
      else if (press?.start.shift) app.select([...app.store.selection, ...inBox()]);
      press = null;
    },
    cancel() {
      press = null;
    },
    /** @param {import("../scene/paint.js").Pen} pen */
    paint({ ctx, theme }) {
      if (!press?.moved || !press.start.shift) return;
      const { start, last } = press;
      ctx.strokeStyle = ctx.fillStyle = theme.css.accent;
      ctx.lineWidth = 1;
      ctx.strokeRect(start.px, start.py, last.px - start.px, last.py - start.py);
      ctx.globalAlpha = 0.12;
      ctx.fillRect(start.px, start.py, last.px - start.px, last.py - start.py);
      ctx.globalAlpha = 1;
    },
  };
}
