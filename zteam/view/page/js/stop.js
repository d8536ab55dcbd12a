/** Stops all robots: a button, a key, and a button of a gamepad. Each page may, also one that only watches. */

/** @param {import("./app.js").App} app */
export const stopRobots = (app) => app.ask({ op: "stop_robots" }, "Not every robot is stopped");

/** @param {import("./app.js").App} app @param {HTMLElement} button */
export function mountStop(app, button) {
  button.addEventListener("click", () => stopRobots(app));
  // Before all other keys, those that drive too.
  window.addEventListener("keydown", listen, true);

  /** @param {KeyboardEvent} event */
  function listen(event) {
    if (event.code !== "Space" || !event.shiftKey || takesText(event.target)) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (!event.repeat) stopRobots(app);
  }
}

/** @param {EventTarget | null} target */
function takesText(target) {
  if (!(target instanceof Element)) return false;
  return target.closest("input:not([type=checkbox], [type=radio], [type=range]), textarea, [contenteditable]") !== null;
}
