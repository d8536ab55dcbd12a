/** What the user must know: above the map why nothing moves and the way out, and that the page only watches; in the footer
 *  the state; and messages. */

import { WATCHING } from "../connection.js";
import { el, iconButton, setText } from "../dom.js";
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
    const text = `${reason ? `${reason[0].toUpperCase()}${reason.slice(1)}. ` : ""}What you see is old. The page comes back by itself when the server does:`;
    return { title: "The view's server is gone", text, way: "zteam view", bad: true };
  }
  if (!team) return { title: "Waiting for the first frame…", text: "" };
  if (!team.router) {
    return { title: "No router", text: "Nothing can be heard of a team. A router starts with the team, or by itself:", way: "zteam-router", bad: true };
  }
  return store.isRecorded ? null : noticeOfTeam(team, seen);
}

/** @param {import("../store.js").Team} team @param {Seen} seen @returns {Notice | null} */
function noticeOfTeam(team, seen) {
  const where = team.namespace ? ` in the namespace ${team.namespace}` : "";
  if (!isHere(team)) {
    if (team.loading) return { title: "Looking for a team…", text: "" };
    if (!seen.team) {
      return { title: "No team yet", text: `Neither a simulator nor a robot is here${where}. Start one; it appears by itself:`, way: "zteam up" };
    }
    return { title: "The team is gone", text: `No simulator and no robot is left${where}. The view waits for the next one:`, way: "zteam up", bad: true };
  }
  if (!team.sim.present && seen.simulator) {
    return { title: "The simulator is gone", text: "The world stands, and robots have no clock. Start it again:", way: `zteam-sim ${team.sim.world || "WORLD"}`, bad: true };
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
  const card = el("div", { role: "status" }), banner = watchingBanner(app);
  document.getElementById("notice")?.append(card, banner.element);
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
    card.replaceChildren(...(notice ? [drawNotice(notice)] : []));
  };
  for (const event of ["connection", "team"]) store.on(event, show);
  show();
  mountToasts(store);
  mountStatus(store, banner.open);
}

/**
 * Says that the page only watches, with a field for the token.
 *
 * @param {import("../app.js").App} app
 */
function watchingBanner({ store, connection }) {
  const title = "The part of the printed address behind #token=, or the whole address";
  const field = el("input", { "aria-label": "Token", placeholder: "Token", title, autocomplete: "off", spellcheck: "false", autocapitalize: "off", maxlength: 256 });
  const text = el("span", { role: "status" }), use = el("button", { type: "submit" }, "Use token");
  let hidden = false, before = "";
  const close = iconButton("close", "Only watch", () => open(false));
  close.classList.add("plain");
  const element = el("form", { class: "card watching", hidden: true, "aria-label": "Right to command" }, el("strong", {}, "Watching only"), text, field, use, close);
  element.addEventListener("submit", (event) => {
    event.preventDefault();
    const given = tokenIn(field.value);
    if (!given) return field.focus();
    field.value = "";
    return connection.useToken(given);
  });
  const show = () => {
    const { state, mayCommand, token } = store.connection;
    if (token === "wrong" && before !== token) hidden = false;
    before = token;
    element.hidden = hidden || state !== "open" || mayCommand || token === "asked";
    const wrong = token === "wrong";
    setText(text, wrong ? "That is not the token of this view. zteam has printed the right one:" : "To send commands, enter the token of the address that zteam printed:");
    text.className = wrong ? "bad" : "muted";
  };
  const open = (/** @type {boolean} */ on) => {
    hidden = !on;
    show();
    if (on) field.focus();
  };
  store.on("connection", show);
  show();
  return { element, open: () => open(true) };
}

/** @param {string} text a token, or an address that has one @returns {string} */
export function tokenIn(text) {
  const fragment = text.trim().split("#").at(-1) ?? "";
  return (fragment.includes("token=") ? new URLSearchParams(fragment).get("token") : fragment) ?? "";
}

/** @param {Notice} notice */
function drawNotice(notice) {
  const text = el("p", {}, notice.text);
  if (notice.way) text.append(" ", el("code", {}, notice.way));
  return el("div", { class: notice.bad ? "card bad" : "card" }, el("strong", {}, notice.title), ...(notice.text ? [text] : []));
}

/** @param {import("../store.js").Store} store */
function mountToasts(store) {
  const place = /** @type {HTMLElement} */ (document.getElementById("toasts"));
  store.on("say", ({ text, level, about = "" }) => {
    const toast = el("div", { class: level, title: "Click to close", "data-about": about, onclick: () => toast.remove() }, text);
    for (const old of [...place.children]) if (old.textContent === text || (about && old.getAttribute("data-about") === about)) old.remove();
    place.append(toast);
    while (place.children.length > MOST_TOASTS) place.firstChild?.remove();
    setTimeout(() => toast.remove(), level === "error" ? TOAST.error : TOAST.info);
  });
}

/** @param {import("../store.js").Store} store @param {() => void} askForToken */
function mountStatus(store, askForToken) {
  const place = /** @type {HTMLElement} */ (document.getElementById("status"));
  const link = el("span"), viewer = el("span", { class: "muted" }), gate = el("span", { class: "grow" });
  const time = el("span", { class: "mono" });
  const watching = el("button", { type: "button", class: "link", title: WATCHING, onclick: askForToken }, "watching only");
  place.append(link, viewer, watching, gate, time);
  const show = () => {
    const { state, mayCommand } = store.connection, { team, frame } = store;
    const silent = (performance.now() - frame.received) / 1000;
    const old = state === "open" && frame.number >= 0 && silent > OLD;
    setText(link, state === "open" ? (old ? `● no frame for ${formatNumber(silent, 0)} s` : "● connected") : `○ ${state}`);
    link.className = state === "open" && !old ? "good" : "bad";
    // Its number matters where others may drive.
    const count = team?.viewers ?? 1;
    setText(viewer, state === "open" && count > 1 ? `viewer ${store.connection.viewer}, ${count} pages` : "");
    watching.hidden = state !== "open" || mayCommand;
    setText(gate, team?.gate.text ?? "");
    gate.title = gate.textContent ?? "";
    gate.className = `grow ${team && team.gate.state !== "go" ? "warn" : "muted"}`;
    setText(time, team?.sim.present ? `tick ${frame.tick}` : "");
    time.title = formatClock(frame.stamp);
  };
  for (const event of ["connection", "team"]) store.on(event, show);
  setInterval(show, 500);
  show();
}
