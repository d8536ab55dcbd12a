/** What `zteam doctor` finds wrong with the team, and the way out; made when the panel is opened, and by a button. */

import { el, reconcile, setText } from "../dom.js";
import { formatTime } from "./format.js";
import { whyNoRight } from "../rights.js";

/** @typedef {{what: string, good: boolean, text: string, next_step: string, level: "ok" | "note" | "problem"}} Finding */
/** @typedef {{running: boolean, time: number, findings: Finding[], error: string}} Examination */

const ORDER = ["problem", "note", "ok"];
/** @type {Record<string, string>} */
const CLASS_OF_LEVEL = { problem: "bad", note: "warn", ok: "good" };

/** @param {import("../app.js").App} app @returns {import("./tabs.js").Tab} */
export function doctorTab(app) {
  const { store } = app;
  const again = el("button", { type: "button", onclick: () => app.ask({ op: "doctor" }, "Doctor") }, "Check again");
  const summary = el("span", { class: "grow", role: "status" });
  const list = el("div", { class: "findings", role: "list", "aria-label": "Findings" });
  const page = el("div", { class: "page" }, el("div", { class: "row under" }, summary, again), el("div", { class: "scroll", tabindex: 0 }, list));
  let shown = false;
  const show = () => {
    if (!shown) return;
    /** @type {Examination | undefined} */
    const doctor = store.docs.doctor, why = whyNoRight(store);
    setText(summary, summaryOf(doctor));
    summary.setAttribute("aria-busy", String(doctor?.running ?? true));
    again.disabled = why !== "" || (doctor?.running ?? true);
    again.title = why || "Run the checks of zteam doctor";
    const findings = [...(doctor?.findings ?? [])].sort((a, b) => ORDER.indexOf(a.level) - ORDER.indexOf(b.level));
    reconcile(list, findings, ({ what, level, text }) => `${level} ${what} ${text}`, createFinding, () => {});
  };
  for (const event of ["doctor", "connection"]) store.on(event, show);
  const open = (/** @type {boolean} */ on) => {
    if (on !== shown) app.connection.want("doctor", on);
    shown = on;
    show();
  };
  return { name: "doctor", title: "Doctor", page, shown: open };
}

/** @param {Examination | undefined} doctor */
function summaryOf(doctor) {
  if (!doctor || (doctor.running && !doctor.time)) return "Checking: this takes some seconds…";
  if (doctor.error) return doctor.error;
  const count = doctor.findings.filter(({ good }) => !good).length;
  const text = count === 0 ? "no problems" : count === 1 ? "1 problem" : `${count} problems`;
  return `${formatTime(doctor.time).split(".")[0]}: ${text}${doctor.running ? "; checking again…" : ""}`;
}

/** @param {Finding} finding */
function createFinding({ what, level, text, next_step }) {
  const head = el("div", {}, el("span", { class: `level ${CLASS_OF_LEVEL[level]}` }, level), el("strong", {}, what));
  const way = next_step ? [el("div", { class: "way" }, "→ ", el("code", {}, next_step))] : [];
  return el("div", { role: "listitem", "data-level": level, "data-what": what }, head, el("div", {}, text), ...way);
}
