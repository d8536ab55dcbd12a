/** All topics with types and rates; of one of them the newest message as a tree, whose numbers can be plotted. */

import { breakable, el, iconButton, reconcile, setAttribute, setText } from "../dom.js";
import { formatNumber } from "./format.js";
import { MessageTree } from "./message_tree.js";

/** @typedef {{key: string, type: string, hz: number | null, publishers: number, subscribers: number}} Topic */

/**
 * @param {import("../app.js").App} app
 * @param {import("../layout.js").Layout} layout
 * @param {(topic: string, field: string) => void} plot
 * @returns {import("./tabs.js").Tab}
 */
export function topicsTab(app, layout, plot) {
  const echo = new Echo(app, layout, plot);
  const filter = el("input", { type: "search", class: "grow", placeholder: "Filter", "aria-label": "Filter of topics" });
  const count = el("span", { class: "muted" });
  const headings = el("tr", {}, el("th", { scope: "col" }, "Topic"), el("th", { scope: "col" }, "Type"));
  headings.append(el("th", { scope: "col", class: "number" }, "Hz"), el("th", { scope: "col", class: "number", title: "Publishers and subscribers" }, "P / S"));
  const table = el("table", { id: "topics", "aria-label": "Topics" }, el("thead", {}, headings));
  const empty = el("div", { class: "hint" });
  const page = el("div", { class: "page" }, el("div", { class: "row" }, filter, count), el("div", { class: "scroll" }, table, empty), echo.element);
  let shown = false;
  const show = () => {
    if (!shown) return;
    /** @type {Topic[]} */
    const known = app.store.docs.topics, topics = known ?? [], wanted = filter.value.toLowerCase();
    const fitting = topics.filter(({ key, type }) => `${key} ${type}`.toLowerCase().includes(wanted));
    table.hidden = topics.length === 0;
    setText(empty, topics.length ? "" : known ? "Nothing is published here." : "Loading the topics…");
    setText(count, !known ? "" : wanted ? `${fitting.length} of ${topics.length}` : `${topics.length} topics`);
    reconcile(table, fitting, ({ key }) => key, (topic) => createRow(topic, (key) => echo.choose(key)), (row, topic) => updateRow(row, topic, echo.topic));
  };
  filter.addEventListener("input", show);
  app.store.on("topics", show);
  echo.onchange = show;
  const open = (/** @type {boolean} */ on) => {
    if (on !== shown) app.connection.want("topics", on);
    shown = on;
    echo.show(on);
    show();
  };
  return { name: "topics", title: "Topics", page, shown: open };
}

/** @param {Topic} topic @param {(key: string) => void} choose */
function createRow(topic, choose) {
  const button = el("button", { type: "button", class: "link", title: `Show the newest message of ${topic.key}` }, ...breakable(topic.key));
  const row = el("tr", { onclick: () => choose(topic.key) }, el("td", { class: "key" }, button), el("td", { class: "muted" }));
  row.append(el("td", { class: "number" }), el("td", { class: "number muted" }));
  return el("tbody", { "data-topic": topic.key }, row);
}

/** @param {HTMLTableSectionElement} rows @param {Topic} topic @param {string} chosen */
function updateRow(rows, topic, chosen) {
  const [name, type, hz, ends] = rows.rows[0].cells;
  rows.classList.toggle("selected", topic.key === chosen);
  setAttribute(/** @type {Element} */ (name.firstElementChild), "aria-pressed", String(topic.key === chosen));
  setText(type, topic.type.split("/").at(-1) ?? "");
  type.title = topic.type;
  setText(hz, topic.hz === null ? "–" : formatNumber(topic.hz, topic.hz < 10 ? 1 : 0));
  setText(ends, `${topic.publishers} / ${topic.subscribers}`);
}

/** The newest message of one topic. */
class Echo {
  topic = "";
  #shown = false;
  onchange = () => {};

  /** @param {import("../app.js").App} app @param {import("../layout.js").Layout} layout @param {(topic: string, field: string) => void} plot */
  constructor(app, layout, plot) {
    this.app = app;
    this.layout = layout;
    this.title = el("span", { class: "grow mono key" });
    this.hint = el("div", { class: "hint" });
    this.tree = new MessageTree((field) => plot(this.topic, field));
    const close = iconButton("close", "Close the message", () => this.choose(""));
    close.classList.add("plain");
    this.element = el("div", { class: "echo", hidden: true }, el("div", { class: "row under" }, this.title, close), el("div", { class: "scroll" }, this.hint, this.tree.element));
    app.store.on("echo", (doc) => this.#take(doc));
    layout.register("echo", { get: () => this.topic, set: (text) => text !== this.topic && this.choose(text) });
  }

  /** @param {string} topic "" for none; the one that is shown is closed */
  choose(topic) {
    if (this.topic && this.#shown) this.app.connection.unwatch(this.topic);
    this.topic = topic === this.topic ? "" : topic;
    if (this.topic && this.#shown) this.app.connection.watch(this.topic);
    this.element.hidden = !this.topic;
    setText(this.title, this.topic);
    setText(this.hint, "Waiting for a message…");
    this.hint.hidden = false;
    this.tree.clear();
    this.layout.changed();
    this.onchange();
  }

  /** @param {boolean} on */
  show(on) {
    if (on === this.#shown) return;
    this.#shown = on;
    if (!this.topic) return;
    if (on) this.app.connection.watch(this.topic);
    else this.app.connection.unwatch(this.topic);
  }

  /** @param {{topic: string, stamp: number, json: any}} doc */
  #take({ topic, json }) {
    if (topic !== this.topic) return;
    this.hint.hidden = true;
    this.tree.show(json);
  }
}
