/** A gamepad drives with its left stick, and stops all robots; the standard layout of the Gamepad API. */

import { stopRobots } from "../stop.js";
import { sharesOfStick } from "./law.js";

const POLL = 50;
/** The right one of the four, which is B or a circle. */
const STOP_BUTTON = 1;
const LEFT_BUTTON = 4,
  RIGHT_BUTTON = 5;

/** @param {import("./driver.js").Driver} driver */
export function listenToGamepads(driver) {
  let timer = 0;
  let pressed = false;
  let stops = false;

  function poll() {
    const pads = navigator.getGamepads().filter((candidate) => candidate?.connected);
    const pad = pads[0];
    const stop = pads.some((each) => each?.buttons[STOP_BUTTON]?.pressed);
    if (stop && !stops) stopRobots(driver.app);
    stops = stop;
    if (!pad || !driver.mode || !document.hasFocus()) return driver.wish("gamepad", sharesOfStick(0, 0));
    driver.wish("gamepad", sharesOfStick(pad.axes[0] ?? 0, pad.axes[1] ?? 0));
    const down = [LEFT_BUTTON, RIGHT_BUTTON].find((button) => pad.buttons[button]?.pressed);
    if (down !== undefined && !pressed) driver.scale(down === LEFT_BUTTON ? "z" : "q");
    pressed = down !== undefined;
  }

  /** Polled only while a gamepad is there. */
  function update() {
    clearInterval(timer);
    timer = 0;
    if (navigator.getGamepads?.().some(Boolean)) timer = setInterval(poll, POLL);
  }
  for (const name of ["gamepadconnected", "gamepaddisconnected"]) window.addEventListener(name, update);
}
