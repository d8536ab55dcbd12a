/** Picture, layout, theme and help, at the right of the tool bar. */

import { download } from "../layout.js";
import { el, iconButton } from "../dom.js";

/** @param {import("../app.js").App} app saves a picture of the map as the user sees it */
export async function savePicture(app) {
  try {
    const blob = await /** @type {any} */ (app).scene.png();
    download(blob, `zteam-${app.store.frame.stamp.toFixed(1)}s.png`);
  } catch (error) {
    app.say(`no picture: ${error}`, "error");
  }
}

/** @typedef {{icon: "picture" | "theme" | "help" | null, text: string, key: string, act: () => void}} Entry of the menu; those
 *  with an icon are buttons too */

/**
 * @param {import("../app.js").App} app
 * @param {import("../layout.js").Layout} layout
 * @param {import("./theme.js").Theme} theme
 * @param {() => void} showHelp
 */
export function mountPageButtons(app, layout, theme, showHelp) {
  const place = /** @type {HTMLElement} */ (document.getElementById("page-buttons"));
  const file = fileInput(app, layout);
  /** @type {Entry[]} */
  const entries = [
    { icon: "picture", text: "Save a picture of the map", key: "Shift+P", act: () => savePicture(app) },
    { icon: null, text: "Save the layout as a file", key: "", act: () => layout.save() },
    { icon: null, text: "Open a layout file…", key: "", act: () => file.click() },
    { icon: null, text: "Copy the address of this view", key: "", act: () => copyAddress(app) },
    { icon: "theme", text: "Dark or light", key: "t", act: () => theme.toggle() },
    { icon: "help", text: "Shortcuts", key: "?", act: showHelp },
  ];
  const buttons = entries.flatMap(({ icon, text, key, act }) => (icon ? [iconButton(icon, `${text} (${key})`, act)] : []));
  place.append(...buttons, menuButton(entries));
}

/** @param {import("../app.js").App} app @param {import("../layout.js").Layout} layout */
function fileInput(app, layout) {
  const file = el("input", { type: "file", accept: ".json,application/json", hidden: true, "aria-label": "Layout file" });
  file.addEventListener("change", async () => {
    const chosen = file.files?.[0];
    if (chosen) await openFile(app, layout, chosen);
    // The same file may be chosen again.
    file.value = "";
  });
  document.body.append(file);
  return file;
}

/** @param {Entry[]} entries @returns {HTMLButtonElement} */
function menuButton(entries) {
  const items = entries.map(({ text, key, act }) => {
    const item = el("button", { type: "button", role: "menuitem" }, el("span", {}, text), ...(key ? [el("kbd", {}, key)] : []));
    item.addEventListener("click", () => {
      show(false);
      act();
    });
    return item;
  });
  const menu = el("div", { class: "menu", role: "menu", hidden: true }, ...items);
  const button = iconButton("menu", "Menu: picture, layout, address", () => show(menu.hidden));
  button.setAttribute("aria-haspopup", "menu");
  const show = (/** @type {boolean} */ on) => {
    const box = button.getBoundingClientRect();
    menu.hidden = !on;
    button.setAttribute("aria-expanded", String(on));
    menu.style.top = `${box.bottom + 4}px`;
    menu.style.right = `${Math.max(window.innerWidth - box.right, 6)}px`;
    if (on) items[0].focus();
  };
  menu.addEventListener("keydown", (event) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (step) items[(items.indexOf(/** @type {any} */ (document.activeElement)) + step + items.length) % items.length].focus();
    if (event.key === "Escape") {
      show(false);
      button.focus();
    }
    if (step || event.key === "Escape") event.stopPropagation();
  });
  document.addEventListener("pointerdown", (event) => {
    const target = /** @type {Node} */ (event.target);
    if (!menu.hidden && !menu.contains(target) && !button.contains(target)) show(false);
  });
  document.getElementById("toolbar")?.append(menu);
  return button;
}

/** @param {import("../app.js").App} app @param {import("../layout.js").Layout} layout @param {File} file */
async function openFile(app, layout, file) {
  let problem;
  try {
    problem = layout.apply(JSON.parse(await file.text()));
  } catch (error) {
    problem = String(error);
  }
  if (problem) app.say(`${file.name}: ${problem}`, "error");
}

/** @param {import("../app.js").App} app */
async function copyAddress(app) {
  try {
    await navigator.clipboard.writeText(location.href);
    app.say("The address is in the clipboard. It holds what you see, and no token.");
  } catch {
    app.say("This browser gives no access to the clipboard: copy the address from its bar.", "error");
  }
}
