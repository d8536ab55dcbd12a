/** Arrows at the edge of the map to the robots outside of it: a click brings them into view. */

import { el, setText } from "../dom.js";

/** Pixels from the edge to the middle of an arrow's button. */
const INSET_X = 48,
  INSET_Y = 16;
/** Where an arrow's place is taken it stands so many places farther along the edge, the nearest first; then it joins another. */
const SHIFTS = [0, 1, -1, 2, -2, 3, -3];
/** Metres shown around the robots that a click brings. */
const AROUND = 1.5;

/** @typedef {{ids: number[], px: number, py: number, angle: number}} Place where an arrow stands, in pixels, and points to */

/**
 * An arrow for each robot outside; many in one direction share one.
 * @param {import("../app.js").App} app @returns {Place[]}
 */
function findPlaces({ store: { poses, selection }, camera }) {
  const { width, height } = camera,
    [cx, cy] = [width / 2, height / 2];
  /** @type {Place[]} */
  const places = [];
  const order = [...poses.ids.subarray(0, poses.count).keys()].sort((a, b) => Number(selection.has(poses.ids[b])) - Number(selection.has(poses.ids[a])));
  for (const i of order) {
    const [x, y] = camera.toScreen(...poses.drawnAt(i));
    if (x >= 0 && y >= 0 && x <= width && y <= height) continue;
    const [dx, dy] = [x - cx, y - cy],
      [across, down] = [Math.max(cx - INSET_X, 1) / Math.abs(dx), Math.max(cy - INSET_Y, 1) / Math.abs(dy)],
      share = Math.min(across, down),
      [px, py] = [cx + share * dx, cy + share * dy];
    const choices = SHIFTS.map((k) => (across < down ? { px, py: py + 2 * k * INSET_Y } : { px: px + 2 * k * INSET_X, py }));
    const free = choices.find((place) => isOnEdge(place, camera) && !places.some((other) => areClose(place, other))),
      joined = free ? null : (places.find((other) => areClose({ px, py }, other)) ?? places[0]);
    if (joined) joined.ids.push(poses.ids[i]);
    else places.push({ ids: [poses.ids[i]], px, py, ...free, angle: Math.atan2(dy, dx) });
  }
  return places;
}

/** @typedef {{px: number, py: number}} Point */

/** @param {Point} a @param {Point} b */
const areClose = (a, b) => Math.abs(a.px - b.px) < 2 * INSET_X - 1 && Math.abs(a.py - b.py) < 2 * INSET_Y - 1;

/** @param {Point} place @param {{width: number, height: number}} screen */
function isOnEdge({ px, py }, { width, height }) {
  return px >= INSET_X - 1 && py >= INSET_Y - 1 && px <= width - INSET_X + 1 && py <= height - INSET_Y + 1;
}

/** @param {import("../app.js").App} app @param {HTMLElement} element the map area */
export function makeOutside(app, element) {
  /** @type {HTMLButtonElement[]} */
  const buttons = [];
  /** The robots of each button. @type {number[][]} */
  const robots = [];

  /** @param {number[]} ids */
  function bring(ids) {
    const { poses } = app.store,
      found = ids.flatMap((id) => poses.drawn(id) ?? []),
      [xs, ys] = [found.map(({ x }) => x), found.map(({ y }) => y)];
    if (!found.length) return;
    const { scale } = app.camera;
    app.camera.fit([Math.min(...xs) - AROUND, Math.min(...ys) - AROUND, Math.max(...xs) + AROUND, Math.max(...ys) + AROUND]);
    app.camera.set({ scale: Math.min(scale, app.camera.scale) });
  }

  /** @param {number} i */
  function makeButton(i) {
    const attributes = { type: "button", class: "outside", "data-own-pointer": true, onclick: () => bring(robots[i]) };
    return element.appendChild(el("button", attributes, el("i"), el("span")));
  }

  return {
    /** @param {import("./colors.js").Theme} theme */
    update(theme) {
      const places = findPlaces(app);
      places.forEach(({ ids, px, py, angle }, i) => {
        const button = (buttons[i] ??= makeButton(i)),
          [arrow, text] = /** @type {HTMLCollectionOf<HTMLElement>} */ (button.children),
          name = app.store.robots.get(ids[0])?.name ?? `robot_${ids[0]}`,
          shown = ids.length > 1 ? `${name} +${ids.length - 1}` : name;
        robots[i] = ids;
        button.hidden = false;
        button.style.translate = `calc(${px.toFixed(1)}px - 50%) calc(${py.toFixed(1)}px - 50%)`;
        button.style.setProperty("--robot", theme.robotCss(ids[0]));
        arrow.style.rotate = `${angle.toFixed(3)}rad`;
        setText(text, shown);
        button.title = `${shown} is outside of the view: show it`;
      });
      for (let i = places.length; i < buttons.length; i++) buttons[i].hidden = true;
    },
  };
}
