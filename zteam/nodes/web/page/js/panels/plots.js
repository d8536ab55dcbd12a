/** Charts of the fields that the user has clicked. The library comes with the first chart. */

import { Plots, SPANS } from "../plots.js";
import { el, iconButton, reconcile, setText } from "./dom.js";
import { formatPlain } from "./format.js";

const DRAW_PERIOD = 150; // ms

/** @typedef {import("../vendor.js").Chart} Chart */
/** @typedef {import("../plots.js").Series} Series */

/**
 * @param {import("../app.js").App} app
 * @param {import("../layout.js").Layout} layout
 * @returns {{tab: import("./tabs.js").Tab, add: (topic: string, field: string) => void}}
 */
export function plotsTab(app, layout) {
  const view = new PlotsView(app, layout);
  return { tab: { name: "plots", title: "Plots", page: view.page, shown: (on) => view.show(on) }, add: (topic, field) => view.plots.add(topic, field) };
}

class PlotsView {
  #shown = false;
  #frozenAt = 0;
  #drawn = 0;
  /** @type {Map<string, UnitChart>} */
  #charts = new Map();

  /** @param {import("../app.js").App} app @param {import("../layout.js").Layout} layout */
  constructor(app, layout) {
    this.store = app.store;
    this.plots = new Plots(app.connection, () => {
      this.#showSeries();
      layout.changed();
    });
    const text = "No plots. Open a topic under Topics and click the name of a number.";
    this.hint = el("div", { class: "hint" }, text);
    this.chips = el("div", { class: "chips grow" });
    this.span = el("select", { "aria-label": "Span of time" }, ...SPANS.map((span) => el("option", { value: span }, `${span} s`)));
    this.span.value = String(this.plots.span);
    this.span.addEventListener("change", () => {
      this.plots.span = Number(this.span.value);
      this.#draw(true);
      layout.changed();
    });
    this.freeze = el("button", { type: "button", onclick: () => this.#toggle() }, "Pause");
    const clear = el("button", { type: "button", onclick: () => { this.plots.clear(); this.#draw(true); } }, "Clear");
    this.area = el("div", { class: "scroll charts" });
    this.page = el("div", { class: "page" }, el("div", { class: "row" }, this.chips, this.span, this.freeze, clear), this.hint, this.area);
    app.store.on("samples", (samples) => this.plots.take(samples));
    app.store.on("frame", () => this.#draw(false));
    app.store.on("theme", () => this.#rebuild());
    new ResizeObserver(() => this.#draw(true)).observe(this.area);
    layout.register("plots", this.plots);
    layout.register("span", { get: () => this.span.value, set: (seconds) => this.#setSpan(seconds) });
    this.#showSeries();
  }

  /** @param {string} seconds */
  #setSpan(seconds) {
    if (!SPANS.includes(Number(seconds))) return;
    this.span.value = seconds;
    this.plots.span = Number(seconds);
  }

  /** @param {boolean} on */
  show(on) {
    this.#shown = on;
    if (on) this.#draw(true);
  }

  #toggle() {
    this.#frozenAt = this.#frozenAt ? 0 : this.store.frame.stamp;
    setText(this.freeze, this.#frozenAt ? "Go on" : "Pause");
    this.freeze.setAttribute("aria-pressed", String(this.#frozenAt > 0));
    this.#draw(true);
  }

  #showSeries() {
    const { series } = this.plots;
    this.hint.hidden = series.length > 0;
    reconcile(this.chips, series, ({ topic, field }) => `${topic}:${field}`, (one) => this.#chip(one), () => {});
    this.#rebuild();
  }

  /** @param {Series} series */
  #chip({ topic, field, color }) {
    const swatch = el("span", { class: "swatch" });
    swatch.style.backgroundColor = color;
    const remove = iconButton("close", `Remove ${topic} ${field}`, () => this.plots.remove(topic, field));
    remove.classList.add("plain");
    return el("span", { class: "chip", title: `${topic} ${field}` }, swatch, el("span", { class: "muted" }, `${topic} `), field, el("output", { class: "mono" }), remove);
  }

  #rebuild() {
    for (const chart of this.#charts.values()) chart.remove();
    this.#charts.clear();
    this.#draw(true);
  }

  /** @param {boolean} now also soon after the last time, or while paused */
  async #draw(now) {
    if (!this.#shown || (!now && (this.#frozenAt || performance.now() - this.#drawn < DRAW_PERIOD))) return;
    this.#drawn = performance.now();
    const { loadChart } = await import("../vendor.js");
    const groups = this.plots.byUnit(), end = this.#frozenAt || this.store.frame.stamp;
    for (const [unit, series] of groups) {
      let chart = this.#charts.get(unit);
      if (!chart) this.#charts.set(unit, (chart = new UnitChart(this.area, loadChart, unit, series)));
      chart.draw(this.plots, end, this.area.clientWidth, Math.max(this.area.clientHeight / Math.min(groups.size, 2) - 4, 130));
    }
    this.plots.series.forEach(({ values }, i) => {
      const output = this.chips.children[i]?.querySelector("output");
      if (output && !this.#frozenAt) setText(output, values.length ? formatPlain(Number(values[values.length - 1].toPrecision(4))) : "…");
    });
  }
}

/** The chart of all series of one unit. */
class UnitChart {
  #start = 0;
  #end = 1;

  /** @param {HTMLElement} area @param {typeof import("../vendor.js").loadChart} make @param {string} unit @param {Series[]} series */
  constructor(area, make, unit, series) {
    this.series = series;
    this.place = el("div", { class: "chart" });
    area.append(this.place);
    this.chart = make(this.place, unit, series, () => [this.#start, this.#end]);
  }

  /** @param {Plots} plots @param {number} end s @param {number} width px @param {number} height px */
  draw(plots, end, width, height) {
    this.#end = end;
    this.#start = end - plots.span;
    const tables = this.series.map((series) => plots.recent(end, series));
    this.chart.draw(tables, Math.floor(width), Math.floor(height));
  }

  remove() {
    this.chart.remove();
    this.place.remove();
  }
}
