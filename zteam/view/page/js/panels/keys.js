/** The panels' shortcuts, and the list of all of them. */

import { SHORTCUTS as MAP_SHORTCUTS } from "../shortcuts.js";
import { isTyped } from "../tools/keys.js";
import { el, iconButton } from "../dom.js";

/** @typedef {{keys: string, text: string, group: string}} Shortcut */

/** @type {Shortcut[]} */
const SHORTCUTS = [
  { keys: "Space", text: "Play or pause, while a recording is shown", group: "Recording" },
  { keys: "← →", text: "A tick back or on; with Shift a second", group: "Recording" },
  { keys: "Home End", text: "To its start, to its end", group: "Recording" },
  { keys: "?", text: "This list", group: "Page" },
  { keys: "1 … 5", text: "Team, simulator, topics, frames, layers", group: "Page" },
  { keys: "6 7", text: "Log, plots", group: "Page" },
  { keys: "8 9", text: "Robot, doctor", group: "Page" },
  { keys: "0", text: "Hide all panels, or show them", group: "Page" },
  { keys: "/", text: "Filter the log", group: "Page" },
  { keys: "Shift+P", text: "Save a picture of the map", group: "Page" },
  { keys: "t", text: "Dark or light", group: "Page" },
];
const TABS = ["team", "simulator", "topics", "frames", "layers", "log", "plots", "robot", "doctor"];

/**
 * @param {import("../app.js").App} app
 * @param {{choose: (name: string) => void, foldAll: () => void, picture: () => void, theme: () => void}} actions
 * @returns {() => void} shows the list
 */
export function mountKeys(app, actions) {
  const dialog = makeHelp();
  const showHelp = () => dialog.showModal();
  /** @type {Record<string, () => void>} */
  const acts = { "?": showHelp, "0": actions.foldAll, P: actions.picture, t: actions.theme };
  TABS.forEach((name, i) => (acts[String(i + 1)] = () => actions.choose(name)));
  acts["/"] = () => {
    actions.choose("log");
    document.getElementById("log-filter")?.focus();
  };
  document.addEventListener("keydown", (event) => {
    const { key, target, ctrlKey, metaKey, altKey } = event;
    const typing = isTyped(event);
    // Esc leaves a field, and its text stays.
    if (key === "Escape" && typing && target instanceof HTMLElement && !dialog.open && !event.defaultPrevented) {
      event.preventDefault();
      return target.blur();
    }
    // While the keys drive a robot, they do nothing else.
    const driving = /** @type {any} */ (app).drive?.mode && key !== "?";
    if (typing || driving || ctrlKey || metaKey || altKey || !Object.hasOwn(acts, key)) return;
    event.preventDefault();
    acts[key]();
  });
  // Space and enter are meant for a robot or the map next, not for the button that the mouse has pressed.
  document.addEventListener("click", ({ target, detail }) => {
    if (detail > 0 && target instanceof Element) target.closest("button")?.blur();
  });
  return showHelp;
}

function makeHelp() {
  const close = iconButton("close", "Close", () => dialog.close());
  const first = "Select a robot by a click in the map or in the table. Choose Goal, and press in the map where it should go; drag for its heading. Or choose Drive, and use the keys or the stick. Stop holds all robots until you release them.";
  const groups = el("div", { class: "help" }, el("p", {}, first));
  const all = [...MAP_SHORTCUTS, ...SHORTCUTS];
  for (const group of new Set(all.map((one) => one.group))) {
    const rows = all.filter((one) => one.group === group).map(({ keys, text }) => el("div", {}, el("dt", {}, ...keysOf(keys)), el("dd", {}, text)));
    groups.append(el("section", {}, el("h3", {}, group), el("dl", {}, ...rows)));
  }
  const dialog = el("dialog", { id: "help", "aria-label": "Shortcuts" }, el("header", {}, el("h2", {}, "Shortcuts"), close), groups);
  dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
  document.body.append(dialog);
  return dialog;
}

const WORDS = new Set(["wheel", "drag", "middle", "right", "arrows", "these", "…"]);

/** @param {string} keys separated by spaces; a comma behind one is no key @returns {(Node | string)[]} */
function keysOf(keys) {
  return keys.split(" ").flatMap((token) => {
    const key = token.length > 1 ? token.replace(/,$/, "") : token;
    return [WORDS.has(key) ? key : el("kbd", {}, key), " "];
  });
}
