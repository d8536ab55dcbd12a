/** The stick for mouse and touch, with the robot that it drives, its speeds and the state of the lease. */

import { sharesOfStick } from "./law.js";

/** How far the knob goes, in pixels. */
const REACH = 44;

/** @param {string} tag @param {string} name class @param {Element} parent */
function add(tag, name, parent) {
  const element = document.createElement(tag);
  element.className = name;
  parent.append(element);
  return element;
}

/** @param {import("./driver.js").Driver} driver @param {HTMLElement} element the map area */
export function mountStick(driver, element) {
  const box = add("div", "drive", element);
  box.dataset.ownPointer = "";
  box.hidden = true;
  const text = add("div", "drive-text", box),
    title = add("strong", "", text),
    state = add("span", "", text),
    speeds = add("span", "", text);
  state.setAttribute("role", "status");
  const pad = add("div", "stick", box),
    knob = add("div", "knob", pad);
  pad.setAttribute("role", "application");
  pad.setAttribute("aria-label", "Stick: drag to drive");
  let pointer = -1;

  /** @param {number} x @param {number} y pixels from the middle, y down */
  function place(x, y) {
    const out = Math.max(1, Math.hypot(x, y) / REACH);
    knob.style.transform = `translate(${x / out}px, ${y / out}px)`;
    driver.wish("stick", sharesOfStick(x / out / REACH, y / out / REACH));
  }

  /** @param {PointerEvent} event */
  function follow(event) {
    if (event.pointerId !== pointer) return;
    const { left, top, width, height } = pad.getBoundingClientRect();
    place(event.clientX - left - width / 2, event.clientY - top - height / 2);
  }

  /** @param {PointerEvent} event */
  function release(event) {
    if (event.pointerId !== pointer) return;
    pointer = -1;
    place(0, 0);
  }

  pad.addEventListener("pointerdown", (event) => {
    if (pointer >= 0) return;
    pointer = event.pointerId;
    pad.setPointerCapture(pointer);
    follow(event);
  });
  pad.addEventListener("pointermove", follow);
  for (const name of /** @type {const} */ (["pointerup", "pointercancel"])) pad.addEventListener(name, release);

  function show() {
    const { store } = driver.app,
      robot = store.robots.get(driver.robot),
      lease = robot?.lease;
    box.hidden = !driver.mode;
    if (!driver.mode) return;
    title.textContent = driver.robot < 0 ? "Select a robot" : `Drive ${robot?.name ?? driver.robot}`;
    const others = lease != null && lease !== store.connection.viewer;
    state.textContent = others
      ? `viewer ${lease} drives`
      : { none: "keys or stick", asked: "asking…", held: "you drive" }[driver.lease];
    box.dataset.lease = others ? "other" : driver.lease;
    speeds.textContent = `${driver.limits.speed.toFixed(2)} m/s · ${driver.limits.turn.toFixed(2)} rad/s`;
  }
  for (const name of ["drive", "team", "selection"]) driver.app.store.on(name, show);
}
