/** A gamepad drives with its left stick; the standard layout of the Gamepad API. */

import { sharesOfStick } from "./law.js";

const POLL = 50;
const LEFT_BUTTON = 4,
  RIGHT_BUTTON = 5;

/** @param {import("./driver.js").Driver} driver */
export function listenToGamepads(driver) {
  let timer = 0;
  let pressed = false;

  function poll() {
    const pad = navigator.getGamepads().find((candidate) => candidate?.connected);
    if (!pad || !driver.mode || !document.hasFocus()) return driver.wish("gamepad", sharesOfStick(0, 0));
    driver.wish("gamepad", sharesOfStick(pad.axes[0] ?? 0, pad.axes[1] ?? 0));
    const down = [LEFT_BUTTON, RIGHT_BUTTON].find((button) => pad.buttons[button]?.pressed);
    if (down !== undefined && !pressed) driver.scale(down === LEFT_BUTTON ? "z" : "q");
    pressed = down !== undefined;
  }

  /** Polled only while a gamepad is there and driving is on. */
  function update() {
    clearInterval(timer);
    timer = 0;
    if (driver.mode && navigator.getGamepads?.().some(Boolean)) timer = setInterval(poll, POLL);
  }
  let mode = false;
  driver.app.store.on("drive", () => {
    if (driver.mode !== mode) update();
    mode = driver.mode;
  });
  for (const name of ["gamepadconnected", "gamepaddisconnected"]) window.addEventListener(name, update);
}
