/** The goals of the moment, above the map: how far each robot is, and a button that gives a goal up. */

import { cancelGoals, isLive, liveGoals, progressText, tellEnds } from "../goals.js";
import { robotColor } from "../robot_colors.js";
import { el, iconButton, reconcile, setText } from "./dom.js";
import { whyNoCommand } from "./rights.js";

/** More are counted. */
const MOST = 8;

/** @typedef {import("../goals.js").Goal} Goal */

/** @param {import("../app.js").App} app @param {HTMLElement} place */
export function mountGoals(app, place) {
  const { store } = app;
  /** The aborted goals that the user has dismissed, by robot: their stamps. @type {Map<number, number>} */
  const dismissed = new Map();
  const title = el("strong", { class: "grow" });
  const all = el("button", { type: "button", onclick: () => cancelGoals(app, liveGoals(store).map(({ robot }) => robot)) }, "Cancel all");
  const rows = el("div"), more = el("div", { class: "muted" });
  const list = el("section", { id: "goals", "aria-label": "Goals", "data-own-pointer": true }, el("header", {}, title, all), rows, more);
  place.append(list);
  const isShown = (/** @type {Goal} */ goal) => isLive(goal) || (goal.state === "aborted" && dismissed.get(goal.robot) !== goal.stamp);
  const chosenFirst = (/** @type {Goal} */ a, /** @type {Goal} */ b) => Number(store.selection.has(b.robot)) - Number(store.selection.has(a.robot));
  /** @param {Goal} goal */
  function act({ robot, stamp }) {
    const goal = (store.docs.goals ?? []).find((/** @type {Goal} */ each) => each.robot === robot);
    if (goal && isLive(goal)) cancelGoals(app, [robot]);
    else dismissed.set(robot, stamp);
    show();
  }
  function show() {
    const goals = /** @type {Goal[]} */ (store.docs.goals ?? []).filter(isShown).sort(chosenFirst);
    const live = goals.filter(isLive).length, why = whyNoCommand(store);
    list.hidden = goals.length === 0;
    setText(title, live === 0 ? "Goals" : live === 1 ? "1 goal" : `${live} goals`);
    all.hidden = live < 2;
    all.disabled = why !== "";
    all.title = why;
    reconcile(rows, goals.slice(0, MOST), ({ robot, stamp }) => `${robot} ${stamp}`, (goal) => createRow(app, goal, () => act(goal)), (row, goal) => updateRow(row, goal, why));
    setText(more, goals.length > MOST ? `and ${goals.length - MOST} more` : "");
  }
  for (const event of ["goals", "team", "selection", "connection", "theme"]) store.on(event, show);
  tellEnds(app);
  show();
}

/** @param {import("../app.js").App} app @param {Goal} goal @param {() => void} act */
function createRow(app, { robot }, act) {
  const swatch = el("span", { class: "swatch" });
  const name = el("button", { type: "button", class: "link robot", onclick: () => app.select([robot]) }, swatch, `robot_${robot}`);
  const text = el("span", { class: "grow" }), cancel = iconButton("close", "", act);
  return Object.assign(el("div", { class: "goal" }, name, text, cancel), { cells: { swatch, text, cancel } });
}

/** @param {ReturnType<typeof createRow>} row @param {Goal} goal @param {string} why nothing can be commanded */
function updateRow({ cells: { swatch, text, cancel } }, goal, why) {
  const live = isLive(goal), label = live ? `Cancel the goal of robot_${goal.robot}` : "Dismiss";
  swatch.style.backgroundColor = robotColor(goal.robot);
  setText(text, [live ? progressText(goal) : goal.state, goal.text].filter(Boolean).join(": "));
  text.className = live ? "grow" : "grow bad";
  cancel.disabled = live && why !== "";
  cancel.title = (live && why) || label;
  cancel.setAttribute("aria-label", label);
}
