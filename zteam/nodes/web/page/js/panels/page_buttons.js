/** Picture, layout, theme and help, at the right of the tool bar. */

import { download } from "../layout.js";
import { el, iconButton } from "./dom.js";

/** @param {import("../app.js").App} app saves a picture of the map as the user sees it */
export async function savePicture(app) {
  try {
    const blob = await /** @type {any} */ (app).scene.png();
    download(blob, `zteam-${app.store.frame.stamp.toFixed(1)}s.png`);
  } catch (error) {
    app.say(`no picture: ${error}`, "error");
  }
}

/**
 * @param {import("../app.js").App} app
 * @param {import("../layout.js").Layout} layout
 * @param {import("./theme.js").Theme} theme
 * @param {() => void} showHelp
 */
export function mountPageButtons(app, layout, theme, showHelp) {
  const place = /** @type {HTMLElement} */ (document.getElementById("page-buttons"));
  const menu = layoutMenu(app, layout);
  const open = iconButton("layout", "Layout: save or open", () => menu.toggle(open));
  open.setAttribute("aria-haspopup", "menu");
  place.append(
    iconButton("picture", "Save a picture of the map (Shift+P)", () => savePicture(app)),
    open,
    iconButton("theme", "Dark or light (t)", () => theme.toggle()),
    iconButton("help", "Short cuts (?)", showHelp),
  );
}

/** @param {import("../app.js").App} app @param {import("../layout.js").Layout} layout */
function layoutMenu(app, layout) {
  const file = el("input", { type: "file", accept: ".json,application/json", class: "hidden", "aria-label": "Layout file" });
  file.addEventListener("change", async () => {
    const chosen = file.files?.[0];
    file.value = "";
    if (chosen) await openFile(app, layout, chosen);
  });
  const item = (/** @type {string} */ text, /** @type {() => void} */ act) => el("button", { type: "button", role: "menuitem", onclick: () => { close(); act(); } }, text);
  const menu = el("div", { class: "menu", role: "menu", hidden: true },
    item("Save the layout as a file", () => layout.save()),
    item("Open a layout file…", () => file.click()),
    item("Copy the address of this view", () => copyAddress(app)));
  document.body.append(menu, file);
  const close = () => (menu.hidden = true);
  const toggle = (/** @type {HTMLElement} */ button) => {
    menu.hidden = !menu.hidden;
    const box = button.getBoundingClientRect();
    menu.style.top = `${box.bottom + 4}px`;
    menu.style.right = `${Math.max(window.innerWidth - box.right, 6)}px`;
    if (!menu.hidden) /** @type {HTMLElement} */ (menu.firstElementChild).focus();
  };
  menu.addEventListener("keydown", (event) => event.key === "Escape" && close());
  document.addEventListener("pointerdown", (event) => {
    if (!(event.target instanceof Element) || !event.target.closest(".menu, [aria-haspopup]")) close();
  });
  return { toggle };
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
