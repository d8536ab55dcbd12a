/** What all processes log: filtered, at its end unless the user scrolled up. */

import { el, setText } from "../dom.js";
import { formatClock, formatTime } from "./format.js";

const LEVELS = ["debug", "info", "warn", "error", "fatal"];
const MOST_ROWS = 1000;
const NEAR_END = 24; // px

/** @typedef {{time: number, stamp?: number, process: string, level: string, text: string}} Line stamp: s of simulated time, where
 *  it is known, as in the bar and in plots */

/** @param {import("../app.js").App} app @param {import("../layout.js").Layout} layout @returns {import("./tabs.js").Tab} */
export function logTab(app, layout) {
  const log = new LogView(app, layout);
  app.connection.want("log", true);
  return { name: "log", title: "Log", page: log.page, badge: log.badge, shown: (on) => log.show(on) };
}

class LogView {
  #shown = false;
  #following = true;
  #missed = 0;
  #troubles = 0;
  #viewer = -1;

  /** @param {import("../app.js").App} app @param {import("../layout.js").Layout} layout */
  constructor({ store }, layout) {
    this.store = store;
    this.badge = el("span", { class: "badge", hidden: true });
    this.level = el("select", { "aria-label": "Minimum level" }, ...LEVELS.map((level) => el("option", {}, level)));
    this.level.value = "info";
    this.process = el("select", { "aria-label": "Process" }, el("option", { value: "" }, "all processes"));
    this.text = el("input", { type: "search", class: "grow", id: "log-filter", placeholder: "Filter  /", "aria-label": "Text in the line" });
    this.tail = el("button", { type: "button", hidden: true, onclick: () => this.#follow(true) }, "↓ End");
    this.clear = el("button", { type: "button", onclick: () => this.#clear() }, "Clear");
    this.lines = el("div", { class: "scroll log", tabindex: 0, role: "log", "aria-label": "Log", "aria-live": "off" });
    this.page = el("div", { class: "page" }, el("div", { class: "row" }, this.level, this.process, this.text, this.tail, this.clear), this.lines);
    for (const control of [this.level, this.process, this.text]) {
      control.addEventListener("input", () => {
        this.#render();
        layout.changed();
      });
    }
    this.lines.addEventListener("scroll", () => this.#scrolled());
    store.on("log", (lines) => this.#add(lines));
    // The server tells its newest lines anew to a page that comes back.
    store.on("connection", ({ state, viewer }) => {
      if (state === "open" && viewer !== this.#viewer) {
        this.#clear();
        this.#troubles = 0;
        this.badge.hidden = true;
      }
      this.#viewer = viewer;
    });
    layout.register("log", { get: () => this.#get(), set: (text) => this.#set(text) });
  }

  /** @param {boolean} on */
  show(on) {
    const opened = on && !this.#shown;
    this.#shown = on;
    if (!opened) return;
    this.#troubles = 0;
    this.badge.hidden = true;
    this.#render();
  }

  /** @param {Line} line */
  #fits({ level, process, text }) {
    if (LEVELS.indexOf(level) < this.level.selectedIndex) return false;
    if (this.process.value && process !== this.process.value) return false;
    const wanted = this.text.value.toLowerCase();
    return !wanted || text.toLowerCase().includes(wanted) || process.includes(wanted);
  }

  /** @param {Line[]} lines */
  #add(lines) {
    for (const process of new Set(lines.map((line) => line.process))) this.#know(process);
    // It says now that there is none.
    if (!this.store.log.length) return this.#render();
    if (!this.#shown) {
      this.#troubles += lines.filter(({ level }) => LEVELS.indexOf(level) >= LEVELS.indexOf("warn")).length;
      this.badge.hidden = this.#troubles === 0;
      setText(this.badge, String(this.#troubles));
      this.badge.title = `${this.#troubles} warnings and errors`;
      return;
    }
    const fitting = lines.filter((line) => this.#fits(line));
    this.lines.querySelector(".hint")?.remove();
    this.lines.append(...fitting.map(drawLine));
    // While the user reads, nothing moves above; old rows go when the end is followed again.
    if (this.#following) this.#follow(true);
    else this.#count(fitting.length);
  }

  /** @param {string} process */
  #know(process) {
    const options = [...this.process.options];
    if (options.some((option) => option.value === process)) return;
    const next = options.find((option) => option.value > process) ?? null;
    this.process.insertBefore(el("option", { value: process }, process), next);
  }

  #render() {
    const rows = this.store.log.filter((line) => this.#fits(line)).slice(-MOST_ROWS).map(drawLine);
    const { log, docs } = this.store;
    const text = log.length ? "No line fits the filter." : docs.log ? "Nothing has been logged yet." : "Loading the log…";
    this.lines.replaceChildren(...(rows.length ? rows : [el("div", { class: "hint" }, text)]));
    this.#follow(true);
  }

  /** @param {boolean} on */
  #follow(on) {
    this.#following = on;
    this.#missed = 0;
    this.tail.hidden = true;
    while (this.lines.children.length > MOST_ROWS) this.lines.firstChild?.remove();
    this.lines.scrollTop = this.lines.scrollHeight;
  }

  /** @param {number} more lines that came while the user reads older ones */
  #count(more) {
    this.#missed += more;
    this.tail.hidden = false;
    setText(this.tail, this.#missed ? `↓ ${this.#missed} new` : "↓ End");
  }

  #scrolled() {
    const { scrollTop, scrollHeight, clientHeight } = this.lines;
    const atEnd = scrollHeight - scrollTop - clientHeight < NEAR_END;
    if (atEnd === this.#following) return;
    if (atEnd) this.#follow(true);
    else {
      this.#following = false;
      this.#count(0);
    }
  }

  #clear() {
    this.store.log.length = 0;
    this.#render();
  }

  #get() {
    return [this.level.value, this.process.value, this.text.value].join("/");
  }

  /** @param {string} text level, process and text, as from `get` */
  #set(text) {
    const [level, process = "", ...rest] = text.split("/");
    if (LEVELS.includes(level)) this.level.value = level;
    if (process) this.#know(process);
    this.process.value = process;
    this.text.value = rest.join("/");
    this.#render();
  }
}

/** @param {Line} line */
export function drawLine({ time, stamp, process, level, text }) {
  const parts = [el("span", { class: "time", title: formatTime(time) }, stamp === undefined ? formatTime(time) : formatClock(stamp)), el("span", { class: "process" }, process)];
  return el("div", { class: "line", "data-level": level }, ...parts, el("span", { class: "level" }, level), el("span", { class: "text" }, text));
}
