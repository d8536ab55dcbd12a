/** The table of robots: what each one is, does and is driven by, and why it stands. A click selects. */

import { robotColor } from "../robot_colors.js";
import { confirmButton, el, reconcile, setAttribute, setText } from "../dom.js";
import { formatAge, formatNumber } from "./format.js";
import { whyNoCommand } from "../rights.js";

/** @typedef {import("../store.js").Robot} Robot */
/** @typedef {HTMLTableSectionElement & {cells: Record<string, HTMLElement>, look: string}} Rows
 *  look: what its rows were made of */

const HELD = "held";
/** @type {Record<string, string>} the class of a state that is good or bad */
const CLASS_OF_STATE = { running: "good", stopped: "warn", silent: "bad", lost: "bad", absent: "bad", fault: "bad", [HELD]: "bad" };
const OLD_STATUS = 2; // s
const AS_BEFORE = "as before";

/** What the world does if it does not run; "" if it runs, or real robots need none. @param {import("../store.js").Team | null} team */
const standing = (team) => (!team || team.sim.state === "running" ? "" : team.sim.state === "gone" ? "no world" : team.sim.state);

/** Its own state; or that it is stopped, or stands with its world, unless it is worse. @param {Robot} robot @param {import("../store.js").Team | null} team */
export function stateOf({ state, stopped }, team) {
  if (CLASS_OF_STATE[state] === "bad") return state;
  if (stopped) return HELD;
  return (state === "running" && standing(team)) || state;
}

/** @param {import("../app.js").App} app @returns {import("./tabs.js").Tab} */
export function teamTab(app) {
  const { store } = app;
  const summary = el("div", { class: "row under" });
  const headings = el("tr", {}, ...["Robot", "State", "Behaviour"].map((text) => el("th", { scope: "col" }, text)));
  headings.append(...["m/s", "Age"].map((text) => el("th", { scope: "col", class: "number" }, text)));
  const table = el("table", { id: "robots", "aria-label": "Robots" }, el("thead", {}, headings));
  const loading = el("div", { class: "hint" }, "Loading the robots…");
  const empty = el("div", { class: "hint" }, "No robots. Start a team with ", el("code", {}, "zteam up"), ".");
  const actions = actionsOf(app);
  const page = el("div", { class: "page" }, summary, el("div", { class: "scroll" }, table, loading, empty), actions.row);
  let shown = false;
  const show = () => {
    if (!shown) return;
    const robots = store.team?.robots ?? [];
    loading.hidden = robots.length > 0 || !(store.team?.loading ?? true);
    empty.hidden = robots.length > 0 || !loading.hidden;
    table.hidden = robots.length === 0;
    setText(summary, summaryOf(store));
    reconcile(table, robots, (robot) => String(robot.id), (robot) => createRows(app, robot), (rows, robot) => updateRows(app, rows, robot));
    actions.show();
  };
  for (const event of ["team", "selection", "connection"]) store.on(event, show);
  store.on("theme", () => {
    for (const rows of table.tBodies) /** @type {Rows} */ (rows).look = "";
    show();
  });
  return { name: "team", title: "Team", page, shown: (on) => { shown = on; show(); } };
}

/** @param {import("../store.js").Store} store */
function summaryOf({ team }) {
  if (!team) return "";
  /** @type {Map<string, number>} */
  const counts = new Map();
  for (const state of team.robots.map((robot) => stateOf(robot, team))) counts.set(state, (counts.get(state) ?? 0) + 1);
  const states = [...counts].map(([state, count]) => (counts.size === 1 ? state : `${count} ${state}`)).join(", ");
  const robots = team.robots.length === 1 ? "1 robot" : `${team.robots.length} robots`;
  // GO stands below the map too.
  const gate = team.gate.state === "go" ? "" : team.gate.text;
  return `${robots}${states ? `: ${states}` : ""}${gate ? ` · ${gate}` : ""}`;
}

/** @param {import("../app.js").App} app @param {Robot} robot @returns {Rows} */
function createRows(app, robot) {
  const swatch = el("span", { class: "swatch" }), name = el("span");
  const choose = (/** @type {MouseEvent} */ event) => select(app, robot.id, event.shiftKey || event.ctrlKey || event.metaKey);
  const button = el("button", { type: "button", class: "link robot" }, swatch, name);
  const state = el("td"), behavior = el("td"), speed = el("td", { class: "number" }), age = el("td", { class: "number" });
  const words = el("span"), start = el("span", { class: "row start", hidden: "" });
  const note = el("td", { colspan: 5 }, words, start);
  const below = el("tr", { class: "note" }, note);
  const rows = el("tbody", { onclick: choose, ondblclick: () => app.inspect(robot.id) }, el("tr", {}, el("td", {}, button), state, behavior, speed, age), below);
  return Object.assign(rows, { cells: { swatch, name, button, state, behavior, speed, age, words, start, below }, look: "" });
}

/** @param {import("../app.js").App} app @param {number} id @param {boolean} more whether the others stay selected */
function select(app, id, more) {
  const chosen = app.store.selection;
  if (!more) return app.select(chosen.has(id) && chosen.size === 1 ? [] : [id]);
  return app.select(chosen.has(id) ? [...chosen].filter((other) => other !== id) : [...chosen, id]);
}

/** @param {import("../app.js").App} app @param {Rows} rows @param {Robot} robot */
function updateRows(app, rows, robot) {
  const { store } = app;
  const { cells } = rows;
  // What a robot said last does not hold in a world that stands.
  setText(cells.speed, standing(store.team) ? "–" : formatNumber(robot.speed, 2));
  setText(cells.age, formatAge(robot.age));
  const look = lookOf(store, robot);
  if (rows.look === look) return;
  rows.look = look;
  updateLook(store, rows, robot);
  showStart(app, rows, robot);
}

/** All that rarely changes in a robot's rows: a table of a thousand robots takes ten times as long with it.
 * @param {import("../store.js").Store} store @param {Robot} robot */
function lookOf({ selection, connection, team }, robot) {
  const old = (robot.age ?? 0) > OLD_STATUS;
  return `${stateOf(robot, team)}|${robot.stopped}|${robot.behavior}|${robot.leader}|${robot.driver}|${robot.reason}|${robot.name}|${robot.model}|${robot.lease}|${robot.localised}|${team?.launcher}|${team?.options}|${connection.viewer}|${connection.mayCommand}|${selection.has(robot.id)}|${robot.present}|${old}`;
}

/** @param {import("../store.js").Store} store @param {Rows} rows @param {Robot} robot */
function updateLook(store, { cells, classList }, robot) {
  const selected = store.selection.has(robot.id);
  classList.toggle("selected", selected);
  classList.toggle("gone", !robot.present);
  setAttribute(cells.button, "aria-pressed", String(selected));
  cells.swatch.style.backgroundColor = robotColor(robot.id);
  setText(cells.name, robot.name || `robot_${robot.id}`);
  const state = stateOf(robot, store.team);
  setText(cells.state, state);
  cells.state.className = CLASS_OF_STATE[state] ?? "";
  cells.state.title = state === HELD ? `${robot.state}, but 'zteam stop' holds it` : "";
  setText(cells.behavior, behaviorOf(robot));
  cells.behavior.title = robot.model ? `model ${robot.model}` : "";
  cells.age.className = `number ${(robot.age ?? 0) > OLD_STATUS ? "bad" : "muted"}`;
  const note = [leaseOf(store, robot), robot.reason].filter(Boolean).join(" · ");
  // The line is there without words too: rows must not move under the pointer.
  setText(cells.words, note);
  cells.words.className = robot.localised ? "" : "bad";
  cells.words.title = note;
}

/** Whether a behaviour may be started for it: it is there, and no process holds its name. @param {Robot} robot */
const lacksProcess = (robot) => robot.present && ["undriven", "lost", "stopped"].includes(robot.state);

/** The way to a behaviour for a robot without a process: a button where `zteam up` runs the team, else a command.
 * @param {import("../app.js").App} app @param {Rows} rows @param {Robot} robot */
function showStart(app, { cells: { start } }, robot) {
  const { team } = app.store, why = whyNoCommand(app.store);
  // One that had a process may have it again as it was: with its leader, navigation and parameters.
  const before = team?.launcher && robot.state !== "undriven" ? [AS_BEFORE] : [];
  const offered = team && lacksProcess(robot) ? [...before, ...team.behaviors] : [];
  const about = offered.length ? `${team?.launcher} ${team?.options} ${offered} ${robot.leader} ${why}` : "";
  if (start.dataset.about === about) return;
  start.dataset.about = about;
  start.hidden = about === "";
  if (start.hidden) return start.replaceChildren();
  const given = before[0] ?? (offered.includes("wander") ? "wander" : offered[0]);
  const does = robot.behavior === "follow" && robot.leader >= 0 ? `--follow ${robot.leader}` : `--behavior ${given}`;
  if (!team?.launcher) return start.replaceChildren("type ", el("code", {}, `zteam-robot --id ${robot.id} ${does}${team?.options}`));
  const behavior = el("select", { "aria-label": `Behaviour of robot_${robot.id}` }, ...offered.map((name) => el("option", { value: name }, name)));
  behavior.value = given;
  const button = el("button", { type: "button" }, "Start");
  button.addEventListener("click", async () => {
    button.disabled = true;
    await app.ask({ op: "start", robot: robot.id, behavior: behavior.value === AS_BEFORE ? "" : behavior.value }, `robot_${robot.id} is not started`);
    button.disabled = false;
  });
  for (const control of [behavior, button]) {
    control.disabled = why !== "";
    control.title = why || "Have zteam up start a process for this robot";
  }
  // A click there must not select the row.
  start.onclick = start.ondblclick = (event) => event.stopPropagation();
  return start.replaceChildren(behavior, button);
}

/** Behaviour and leader, and in front of it what else drives. @param {Robot} robot */
export function behaviorOf({ behavior, leader, driver }) {
  const follows = leader !== null && leader >= 0;
  // The line has turned round: the one that led it follows, and a follower leads.
  const text = behavior === "follow" ? (follows ? `follow robot_${leader}` : "follow, leads") : follows ? `${behavior}, follows robot_${leader}` : behavior;
  // The behaviour idle is what a robot runs that navigation drives.
  if (driver === "navigation" && ["idle", ""].includes(text)) return driver;
  return ["behavior", "none", ""].includes(driver) ? text || "–" : `${driver} (${text})`;
}

/** @param {import("../store.js").Store} store @param {Robot} robot */
function leaseOf(store, robot) {
  if (robot.lease === null || robot.lease === undefined) return "";
  return robot.lease === store.connection.viewer ? "driven by you" : `driven by viewer ${robot.lease}`;
}

/** What can be done with the selected robots. @param {import("../app.js").App} app */
function actionsOf(app) {
  const { store } = app;
  const text = el("span", { class: "muted grow" });
  const first = () => [...store.selection][0];
  const follow = el("button", { type: "button", onclick: () => app.camera.set({ follow: app.camera.follow === first() ? -1 : first() }) }, "Follow");
  const inspect = el("button", { type: "button", onclick: () => app.inspect(first()) }, "Inspect");
  const none = el("button", { type: "button", onclick: () => app.select([]) }, "Deselect");
  const remove = confirmButton("Remove", "Click again to remove", async () => {
    for (const robot of store.selection) await app.ask({ op: "remove", robot }, `Remove robot_${robot}`);
  });
  remove.classList.add("danger");
  const row = el("div", { class: "row over" }, text, inspect, follow, none, remove);
  const show = () => {
    const count = store.selection.size, why = whyNoCommand(store);
    row.hidden = count === 0;
    setText(text, count === 1 ? `robot_${first()}` : `${count} robots`);
    setText(follow, app.camera.follow === first() ? "Unfollow" : "Follow");
    follow.hidden = inspect.hidden = count !== 1;
    remove.disabled = why !== "" || !store.team?.sim.present;
    remove.title = why || (store.team?.sim.present ? "Take the selected robots out of the world" : "there is no simulator");
  };
  store.on("camera", show);
  return { row, show };
}
