/** The buttons of the tools and of the camera. */

import { el } from "../dom.js";
import { whyNoTool } from "../rights.js";
import { toggleFollow } from "./keys.js";

const SVG = "http://www.w3.org/2000/svg";

/** Paths on a field of 24 x 24. */
const ICONS = /** @type {Record<string, string>} */ ({
  select: "M5 3l14 8-6 1.5L10 19z",
  goal: "M6 21V4h11l-3 4 3 4H6",
  pose: "M12 3a6 6 0 0 1 6 6c0 4.5-6 12-6 12S6 13.5 6 9a6 6 0 0 1 6-6zm0 4a2 2 0 1 0 0 4 2 2 0 0 0 0-4z",
  move: "M12 2v20M2 12h20M12 2l-3 3M12 2l3 3M12 22l-3-3M12 22l3-3M2 12l3-3M2 12l3 3M22 12l-3-3M22 12l-3 3",
  measure: "M3 16L16 3l5 5L8 21zM7 12l2 2M10 9l3 3M13 6l2 2",
  drive:
    "M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18zm0 6.5a2.5 2.5 0 1 0 0 5 2.5 2.5 0 0 0 0-5zM3.5 10.5c3-1.5 14-1.5 17 0M12 14.5V21",
  fit: "M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5",
  follow: "M12 7a5 5 0 1 0 0 10 5 5 0 0 0 0-10zM12 2v5M12 17v5M2 12h5M17 12h5",
});

const TOOLS = [
  { name: "select", word: "Select", title: "Select (s): click, Shift+click adds, Shift+drag a box" },
  { name: "goal", word: "Goal", title: "Goal (g): press for the place, drag for the heading" },
  { name: "pose", word: "Pose", title: "Initial pose (p): press for the place, drag for the heading" },
  { name: "move", word: "Move", title: "Move a robot in the simulator (v): drag it; the wheel turns it" },
  { name: "measure", word: "Measure", title: "Measure (r)" },
];

/** @param {string} name @param {string} word @param {string} title @param {() => void} act */
function makeButton(name, word, title, act) {
  const svg = document.createElementNS(SVG, "svg"),
    path = document.createElementNS(SVG, "path");
  svg.setAttribute("viewBox", "0 0 24 24");
  path.setAttribute("d", ICONS[name]);
  svg.append(path);
  const attributes = { type: "button", class: "tool", title, "aria-label": title, "data-tool": name, onclick: act };
  return el("button", attributes, svg, el("span", {}, word));
}

/** @param {import("../app.js").App} app @param {HTMLElement} bar */
export function mountToolbar(app, bar) {
  const tools = TOOLS.map(({ name, word, title }) => makeButton(name, word, title, () => app.useTool(name)));
  const drive = makeButton("drive", "Drive", "Drive the selected robot (d)", () => app.drive?.set(!app.drive.mode));
  const fit = makeButton("fit", "Team", "Keep the team in view (f); Home shows the whole map", () => app.scene?.keepTeam());
  const follow = makeButton("follow", "Follow", "Follow the selected robot with the view (Shift+F)", () => toggleFollow(app));
  bar.append(...tools, drive, el("span", { class: "separator" }), fit, follow);

  let looks = "";
  app.store.on("camera", ({ follow: robot, placed }) => {
    if (looks !== (looks = `${robot} ${placed}`)) show();
  });

  function show() {
    for (const button of [...tools, drive]) {
      const why = whyNoTool(app, button.dataset.tool ?? ""),
        label = button.getAttribute("aria-label") ?? "";
      // While one drives, that is what the keys are for.
      button.setAttribute("aria-pressed", String(button.dataset.tool === app.tool && !app.drive?.mode));
      button.disabled = why !== "";
      button.title = why ? `${label}. Not now: ${why}` : label;
    }
    drive.setAttribute("aria-pressed", String(app.drive?.mode ?? false));
    fit.setAttribute("aria-pressed", String(!app.camera.placed));
    follow.setAttribute("aria-pressed", String(app.camera.follow >= 0));
  }
  for (const name of ["tool", "drive", "connection", "team", "selection"]) app.store.on(name, show);
  show();
}
