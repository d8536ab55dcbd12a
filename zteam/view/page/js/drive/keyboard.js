/** The keys that drive. A key counts from press to release, as long as the page has the focus. */

import { isTyped } from "../tools/keys.js";
import { isDirection, isFactor, sharesOfKeys } from "./law.js";

const MODIFIERS = new Set(["Shift", "Control", "Alt", "Meta", "CapsLock", "AltGraph"]);
/** Keys of the page that neither drive nor stop. */
const PAGE_KEYS = new Set(["?", "F5", "F11", "F12"]);

/** @param {import("./driver.js").Driver} driver */
export function listenToDriveKeys(driver) {
  /** What is held, by the place of the key: Shift may be released before the letter. @type {Map<string, string>} */
  const held = new Map();
  const wish = () => driver.wish("keys", sharesOfKeys(held.values()));

  /** @param {KeyboardEvent} event */
  function down(event) {
    const { key } = event;
    if (
      !driver.mode ||
      isTyped(event) ||
      event.ctrlKey ||
      event.altKey ||
      event.metaKey ||
      MODIFIERS.has(key) ||
      PAGE_KEYS.has(key)
    ) {
      return;
    }
    event.preventDefault();
    if (key === "Escape") return driver.set(false);
    if (event.repeat) return isFactor(key) ? driver.scale(key) : undefined;
    if (isDirection(key)) {
      held.set(event.code, key);
      return wish();
    }
    if (isFactor(key)) return driver.scale(key);
    held.clear();
    if (key === "Tab") driver.next();
    else driver.stop();
  }

  window.addEventListener("keydown", down);
  window.addEventListener("keyup", (event) => {
    if (held.delete(event.code)) wish();
  });
  driver.app.store.on("drive", () => {
    if (driver.lease === "none") held.clear();
  });
  window.addEventListener("blur", () => held.clear());
}
