/** The goals of the moment, above the map: how far each robot is, and a button that gives a goal up. */

import { cancelGoals, isLive, liveGoals, pausedLists, progressText, tellEnds } from "../goals.js";
import { robotColor } from "../robot_colors.js";
import { el, iconButton, reconcile, setText } from "../dom.js";
import { whyNoCommand } from "../rights.js";

/** More are counted. */
const MOST = 8;

/** @typedef {import("../goals.js").Goal} Goal */

/** @param {import("../app.js").App} app @param {HTMLElement} place */
export function mountGoals(app, place) {
  const { store } = app;
  /** The aborted goals that the user has dismissed, by robot: their stamps. @type {Map<number, number>} */
  const dismissed = new Map();
  // A click folds the list away from the map.
  const title = el("button", { type: "button", class: "link grow", title: "Fold the list of goals, or show it", "aria-expanded": "true", onclick: () => fold() });
  const all = el("button", { type: "button", onclick: () => cancelGoals(app, liveGoals(store).map(({ robot }) => robot), true) }, "Cancel all");
  const rows = el("div"), more = el("div", { class: "muted" });
  const text = el("span", { class: "grow" }), resume = el("button", { type: "button", onclick: () => app.ask({ op: "resume_lists" }, "Go on") }, "Go on");
  const paused = el("div", { class: "goal" }, text, resume);
  const list = el("section", { id: "goals", "aria-label": "Goals", "data-own-pointer": true }, el("header", {}, title, all), rows, more, paused);
  place.append(list);
  function fold() {
    rows.hidden = more.hidden = !rows.hidden;
    title.setAttribute("aria-expanded", String(!rows.hidden));
  }
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
    const live = goals.filter(isLive).length, why = whyNoCommand(store), waiting = pausedLists(store);
    list.hidden = goals.length === 0 && waiting.length === 0;
    paused.hidden = waiting.length === 0;
    setText(text, `${waiting.slice(0, MOST).join(", ")}${waiting.length > MOST ? " …" : ""}: the list is paused`);
    resume.disabled = why !== "";
    resume.title = why || "Let the robots drive to the next goals of their lists";
    setText(title, live === 0 ? "Goals" : live === 1 ? "1 goal" : `${live} goals`);
    const drives = goals.some((goal) => isLive(goal) && store.team?.lists[goal.robot] === false);
    all.hidden = live < 2 && !drives;
    all.disabled = why !== "";
    all.title = why || "Cancel all goals, and pause the lists that send the next ones";
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
