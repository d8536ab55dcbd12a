/** What the user must know: above the map why nothing moves and the way out, in the footer the state, and messages. */

import { el, setText } from "./dom.js";
import { formatClock, formatNumber } from "./format.js";

const TOAST = { info: 4000, error: 9000 }; // ms
const MOST_TOASTS = 4;
const OLD = 2; // s without a frame or of a robot's status: said to be old

/** @typedef {{title: string, text: string, way?: string, bad?: boolean}} Notice way: a command to type */
/** @typedef {{team: boolean, simulator: boolean}} Seen what has been here since the page was opened: a team of real robots has
 *  no simulator, and misses none */

/**
 * The most important thing that keeps the team from being seen, or null.
 *
 * @param {import("../store.js").Store} store
 * @param {Seen} seen
 * @returns {Notice | null}
 */
export function chooseNotice(store, seen) {
  const { state, reason } = store.connection, team = store.team;
  if (state === "connecting") return { title: "Connecting to the view…", text: "" };
  if (state === "refused") {
    return { title: "The view's server refused this page", text: `${reason}. Reload the page; it tries again by itself.`, bad: true };
  }
  if (state === "lost") {
    const text = `${reason ? `${reason}. ` : ""}What you see is old. The page comes back by itself when the server does:`;
    return { title: "The view's server is gone", text, way: "zteam view", bad: true };
  }
  if (!team) return { title: "Waiting for the first frame…", text: "" };
  if (!team.router) {
    return { title: "No router", text: "Nothing can be heard of a team. A router starts with the team, or by itself:", way: "zteam-router", bad: true };
  }
  return noticeOfTeam(team, seen);
}

/** @param {import("../store.js").Team} team @param {Seen} seen @returns {Notice | null} */
function noticeOfTeam(team, seen) {
  const where = team.namespace ? ` in the namespace ${team.namespace}` : "";
  if (!isHere(team)) {
    if (!seen.team) {
      return { title: "No team yet", text: `Neither a simulator nor a robot is here${where}. Start one; it appears by itself:`, way: "zteam up" };
    }
    return { title: "The team is gone", text: `No simulator and no robot is left${where}. The view waits for the next one:`, way: "zteam up", bad: true };
  }
  if (!team.sim.present && seen.simulator) {
    return { title: "The simulator is gone", text: "The world stands, and robots have no clock. Start it again:", way: "zteam-sim WORLD", bad: true };
  }
  return null;
}

/** @param {import("../store.js").Team} team */
function isHere(team) {
  return team.sim.present || team.robots.some((robot) => robot.present);
}

/** @param {import("../app.js").App} app */
export function mountNotices(app) {
  const { store } = app;
  const place = /** @type {HTMLElement} */ (document.getElementById("notice"));
  const seen = { team: false, simulator: false };
  let last = "";
  const show = () => {
    const team = store.team;
    if (team && isHere(team)) seen.team = true;
    if (team?.sim.present) seen.simulator = true;
    const notice = chooseNotice(store, seen);
    const key = JSON.stringify(notice);
    if (key === last) return;
    last = key;
    place.replaceChildren(...(notice ? [drawNotice(notice)] : []));
  };
  for (const event of ["connection", "team"]) store.on(event, show);
  show();
  mountToasts(store);
  mountStatus(store);
}

/** @param {Notice} notice */
function drawNotice(notice) {
  const text = el("p", {}, notice.text);
  if (notice.way) text.append(" ", el("code", {}, notice.way));
  return el("div", { class: notice.bad ? "bad" : "" }, el("strong", {}, notice.title), ...(notice.text ? [text] : []));
}

/** @param {import("../store.js").Store} store */
function mountToasts(store) {
  const place = /** @type {HTMLElement} */ (document.getElementById("toasts"));
  store.on("say", ({ text, level }) => {
    const toast = el("div", { class: level, title: "Click to close", onclick: () => toast.remove() }, text);
    for (const old of place.children) if (old.textContent === text) old.remove();
    place.append(toast);
    while (place.children.length > MOST_TOASTS) place.firstChild?.remove();
    setTimeout(() => toast.remove(), level === "error" ? TOAST.error : TOAST.info);
  });
}

/** @param {import("../store.js").Store} store */
function mountStatus(store) {
  const place = /** @type {HTMLElement} */ (document.getElementById("status"));
  const link = el("span"), rights = el("span", { class: "muted" }), gate = el("span", { class: "grow" });
  const viewers = el("span", { class: "muted" }), time = el("span", { class: "mono" });
  place.append(link, rights, gate, viewers, time);
  const show = () => {
    const { state, viewer, mayCommand } = store.connection, { team, frame } = store;
    const silent = (performance.now() - frame.received) / 1000;
    const old = state === "open" && frame.number >= 0 && silent > OLD;
    setText(link, state === "open" ? (old ? `● no frame for ${formatNumber(silent, 0)} s` : "● connected") : `○ ${state}`);
    link.className = state === "open" && !old ? "good" : "bad";
    const title = "Open the address with #token=… that zteam printed to command the team";
    setText(rights, state !== "open" ? "" : mayCommand ? `viewer ${viewer}` : `viewer ${viewer}, watching only`);
    rights.title = state === "open" && !mayCommand ? title : "";
    setText(gate, team ? gateText(team) : "");
    gate.title = gate.textContent ?? "";
    gate.className = `grow ${team && team.gate.state !== "go" ? "warn" : "muted"}`;
    setText(viewers, team && team.viewers > 1 ? `${team.viewers} viewers` : "");
    setText(time, team?.sim.present ? `tick ${frame.tick}` : "");
    time.title = formatClock(frame.stamp);
  };
  for (const event of ["connection", "team"]) store.on(event, show);
  setInterval(show, 500);
  show();
}

/** @param {import("../store.js").Team} team @returns {string} */
export function gateText(team) {
  if (team.gate.state === "go") return team.gate.text || "GO";
  if (team.gate.text) return team.gate.text;
  const waiting = team.gate.waiting_for.map((/** @type {any} */ one) => `robot_${one.id}${one.reason ? ` (${one.reason})` : ""}`);
  return waiting.length ? `waiting for ${waiting.join(", ")}` : "";
}
