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

/** @param {import("../app.js").App} app @param {() => [number, number, number, number] | null} mapBox the map's extent */
export function makeKeeper({ store, camera }, mapBox) {
  let last = 0,
    fitted = "";

  /** The robots as they are drawn, with this many metres around them: left, top, right, bottom in pixels; and how many
   * times larger that would fit on the screen. @param {number} margin */
  function look(margin) {
    const box = [Infinity, Infinity, -Infinity, -Infinity],
      around = margin * camera.scale;
    for (let i = 0; i < store.poses.count; i++) {
      const [px, py] = camera.toScreen(...store.poses.drawnAt(i));
      box[0] = Math.min(box[0], px - around);
      box[1] = Math.min(box[1], py - around);
      box[2] = Math.max(box[2], px + around);
      box[3] = Math.max(box[3], py + around);
    }
    return { box, fits: Math.min(camera.width / (box[2] - box[0]), camera.height / (box[3] - box[1])) };
  }

  /** Brings the point of the screen that lies so far right of and below its middle nearer to that, and makes the map
   * larger. @param {number} dx @param {number} dy pixels @param {number} zoom @param {number} [share] of the way */
  function go(dx, dy, zoom, share = 1) {
    const [x, y] = camera.toMap(camera.width / 2 + share * dx, camera.height / 2 + share * dy);
    camera.show({ x, y, scale: camera.scale * zoom ** share, follow: -1 });
  }

  /** Goes some of the shortest way to a view that has the robots and this margin inside, zoomed by `wish` if they fit.
   * @param {number} margin m @param {number} wish @param {number} [share] @returns {boolean} whether there is a way */
  function approach(margin, wish, share) {
    const { box, fits } = look(margin),
      zoom = Math.min(wish, fits),
      dx = overhang(box[0], box[2], camera.width, zoom),
      dy = overhang(box[1], box[3], camera.height, zoom);
    if (Math.hypot(dx, dy) < 0.5 && Math.abs(zoom - 1) < 1e-3) return false;
    go(dx, dy, zoom, share);
    return true;
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
        isThere = store.poses.count > 0,
        map = isThere ? null : mapBox(),
        about = `${isThere} ${map} ${camera.width} ${camera.height}`,
        first = about !== fitted;
      last = now;
      fitted = about;
      if (!isThere) {
        if (first && map) camera.fit(map);
        camera.placed = false;
        return false;
      }
      const { box, fits } = look(AROUND);
      if (first) {
        go((box[0] + box[2] - camera.width) / 2, (box[1] + box[3] - camera.height) / 2, fits);
        return false;
      }
      const moves = approach(INSIDE, fits > LOOSE ? fits : 1, 1 - Math.exp(-passed / TIME));
      if (moves) approach(LEAST, 1);
      return moves;
    },
  };
}

/** How far something from `low` to `high` would reach over the edge of a screen zoomed about its middle, in pixels of now:
 * negative over the first edge. @param {number} low @param {number} high @param {number} size @param {number} zoom */
function overhang(low, high, size, zoom) {
  const spare = size / 2 - size / 2 / zoom;
  return Math.min(low - spare, 0) + Math.max(high - size + spare, 0);
}
