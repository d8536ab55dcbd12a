/**
 * Until the user moves the camera it keeps all robots in view. It stands as long as they are well inside, goes along with
 * the one that comes near the edge, and zooms out when they spread. It comes nearer only where much room is left.
 */

/** Metres around the robots: at first, as long as the view moves, and at least. */
const AROUND = 3,
  INSIDE = 1.5,
  LEAST = 0.5;
/** The view comes nearer when the robots could be shown this many times larger. */
const LOOSE = 2;
/** Milliseconds in which two thirds of the way are done, and the longest step. */
const TIME = 400,
  LONGEST = 100;

/** @typedef {{u: number, v: number, scale: number}} Sight the middle of the screen in metres to the right and up, as the map is
 *   turned, and pixels a metre */
/** @typedef {[number, number, number, number]} Box left, lowest, right, highest in these metres */

/** @param {import("../app.js").App} app @param {() => [number, number, number, number] | null} mapBox the map's extent */
export function makeKeeper({ store, camera }, mapBox) {
  let last = 0,
    fitted = "";

  /** @returns {Box} around the robots as they are drawn */
  function teamBox() {
    const { poses } = store,
      [c, s] = [Math.cos(camera.angle), Math.sin(camera.angle)];
    /** @type {Box} */
    const box = [Infinity, Infinity, -Infinity, -Infinity];
    for (let i = 0; i < poses.count; i++) {
      const [x, y] = poses.drawnAt(i),
        u = c * x - s * y,
        v = s * x + c * y;
      box[0] = Math.min(box[0], u);
      box[1] = Math.min(box[1], v);
      box[2] = Math.max(box[2], u);
      box[3] = Math.max(box[3], v);
    }
    return box;
  }

  /** @param {Sight} sight */
  function show({ u, v, scale }) {
    const [c, s] = [Math.cos(camera.angle), Math.sin(camera.angle)];
    camera.show({ x: c * u + s * v, y: c * v - s * u, scale, follow: -1 });
  }

  return {
    /** Keep the team in view from now on, at once. */
    begin() {
      camera.placed = false;
      fitted = "";
      this.step(performance.now());
    },

    /** @param {number} now ms @returns {boolean} whether the view goes on moving without new poses */
    step(now) {
      if (camera.placed || camera.held) return false;
      const passed = Math.min(now - last, LONGEST),
        { count } = store.poses,
        box = count ? null : mapBox();
      last = now;
      const about = count ? `${camera.width} ${camera.height}` : `${box} ${camera.width} ${camera.height}`,
        first = about !== fitted;
      fitted = about;
      if (!count) {
        if (first && box) camera.fit(box);
        camera.placed = false;
        return false;
      }
      const team = teamBox(),
        scale = scaleFor(camera, team, AROUND);
      if (first) {
        show({ u: (team[0] + team[2]) / 2, v: (team[1] + team[3]) / 2, scale });
        return false;
      }
      const [c, s] = [Math.cos(camera.angle), Math.sin(camera.angle)],
        sight = { u: c * camera.x - s * camera.y, v: s * camera.x + c * camera.y, scale: camera.scale },
        aim = within(camera, scale > LOOSE * sight.scale ? { ...sight, scale } : sight, team, INSIDE),
        share = 1 - Math.exp(-passed / TIME);
      if (isNear(aim, sight)) return false;
      const next = within(camera, mix(sight, aim, share), team, LEAST);
      show(next);
      return true;
    },
  };
}

/** @typedef {{width: number, height: number}} Size pixels */

/** The scale at which a box fits on the screen with a margin. @param {Size} size @param {Box} box @param {number} margin m */
function scaleFor({ width, height }, [left, low, right, high], margin) {
  return Math.min(width / (right - left + 2 * margin), height / (high - low + 2 * margin));
}

/** The sight that shows a box with a margin and is nearest to another one. @param {Size} size @param {Sight} sight
 * @param {Box} box @param {number} margin m @returns {Sight} */
export function within(size, { u, v, scale }, box, margin) {
  const [left, low, right, high] = box,
    fitting = Math.min(scale, scaleFor(size, box, margin)),
    [across, up] = [size.width / 2 / fitting - margin, size.height / 2 / fitting - margin];
  return {
    u: Math.min(Math.max(u, right - across), left + across),
    v: Math.min(Math.max(v, high - up), low + up),
    scale: fitting,
  };
}

/** @param {Sight} from @param {Sight} to @param {number} share @returns {Sight} */
function mix(from, to, share) {
  return {
    u: from.u + share * (to.u - from.u),
    v: from.v + share * (to.v - from.v),
    scale: from.scale + share * (to.scale - from.scale),
  };
}

/** Whether two sights differ by less than half a pixel. @param {Sight} a @param {Sight} b */
function isNear(a, b) {
  return Math.hypot(a.u - b.u, a.v - b.v) * b.scale < 0.5 && Math.abs(a.scale / b.scale - 1) < 1e-3;
}
