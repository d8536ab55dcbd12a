/** Charts of the fields that the user has clicked, one for each unit. The library comes with the first chart. */

import { ownerOf } from "../layers.js";
import { Plots, SPANS } from "../plots.js";
import { robotColor } from "../robot_colors.js";
import { el, iconButton, setText } from "../dom.js";
import { formatClock, formatPlain } from "./format.js";

const DRAW_PERIOD = 150; // ms
const LOWEST = 110; // px
const MARGIN = 12; // px around a chart

/** @typedef {import("../plots.js").Series} Series */

/**
 * @param {import("../app.js").App} app
 * @param {import("../layout.js").Layout} layout
 * @returns {{tab: import("./tabs.js").Tab, plots: Plots}}
 */
export function plotsTab(app, layout) {
  const view = new PlotsView(app, layout);
  return { tab: { name: "plots", title: "Plots", page: view.page, shown: (on) => view.show(on) }, plots: view.plots };
}

class PlotsView {
  #shown = false;
  /** The end of the time axis while it stands still, else 0. */
  #frozenAt = 0;
  #drawn = 0;
  /** @type {UnitChart[]} */
  #charts = [];

  /** @param {import("../app.js").App} app @param {import("../layout.js").Layout} layout */
  constructor(app, layout) {
    this.store = app.store;
    this.plots = new Plots(app.connection, () => {
      this.#rebuild();
      app.store.emit("plots");
      layout.changed();
    });
    this.span = el("select", { "aria-label": "Span of time" }, ...SPANS.map((span) => el("option", { value: span }, `${span} s`)));
    this.span.value = String(this.plots.span);
    this.span.addEventListener("change", () => {
      this.#setSpan(this.span.value);
      layout.changed();
    });
    this.freeze = el("button", { type: "button", onclick: () => this.#toggle() }, "Freeze");
    this.area = el("div", { class: "scroll charts" });
    this.page = el("div", { class: "page plots" }, this.area, el("div", { class: "controls" }, this.span, this.freeze, this.#clearButton()));
    app.store.on("samples", (samples) => this.plots.take(samples));
    app.store.on("frame", () => this.#draw(false));
    app.store.on("theme", () => this.#rebuild());
    new ResizeObserver(() => this.#draw(true)).observe(this.area);
    layout.register("plots", this.plots);
    layout.register("span", { get: () => this.span.value, set: (seconds) => this.#setSpan(seconds) });
    this.#rebuild();
  }

  #clearButton() {
    const clear = () => {
      this.plots.clear();
      this.#draw(true);
    };
    return el("button", { type: "button", onclick: clear }, "Clear");
  }

  /** @param {string} seconds */
  #setSpan(seconds) {
    if (!SPANS.includes(Number(seconds))) return;
    this.span.value = seconds;
    this.plots.span = Number(seconds);
    this.#draw(true);
  }

  /** @param {boolean} on */
  show(on) {
    this.#shown = on;
    this.#draw(true);
  }

  #toggle() {
    this.#frozenAt = this.#frozenAt ? 0 : this.store.frame.stamp;
    setText(this.freeze, this.#frozenAt ? "Go on" : "Freeze");
    this.freeze.classList.toggle("on", this.#frozenAt > 0);
    this.#draw(true);
  }

  /** All charts anew: for other series, or in other colours. */
  async #rebuild() {
    for (const chart of this.#charts) chart.remove();
    this.#charts = [];
    const { series } = this.plots;
    const text = "No plots. Open a topic under Topics, and click the name of a number.";
    this.area.replaceChildren(...(series.length ? [] : [el("div", { class: "hint" }, text)]));
    if (!series.length) return;
    const { makeChart } = await import("../vendor.js");
    // Another call was faster, or the series are other ones by now.
    if (this.#charts.length || this.plots.series.length === 0) return;
    for (const [unit, group] of this.plots.byUnit()) this.#charts.push(new UnitChart(this.area, makeChart, unit, group, this.plots));
    this.#draw(true);
  }

  /** @param {boolean} now also soon after the last time, or while the axis stands still */
  #draw(now) {
    if (!this.#shown || (!now && (this.#frozenAt || performance.now() - this.#drawn < DRAW_PERIOD))) return;
    this.#drawn = performance.now();
    const end = this.#frozenAt || this.store.frame.stamp;
    for (const chart of this.#charts) chart.draw(end, this.area.clientHeight);
  }
}

/** The end of a field's path: the chip's tooltip has all of it. @param {string} field */
const shorten = (field) => field.split(".").slice(-2).join(".");

/** Of a time axis, as in the tool bar. @param {number} seconds */
const timeText = (seconds) => formatClock(seconds).replace(/\.0\b/, "");

/** Dashes of a robot's further curves in one chart, in pixels. */
const DASHES = [[], [8, 4], [2, 3], [10, 3, 2, 3]];

/** A curve has its robot's colour, the next one of the same robot other dashes. What belongs to no robot has the text's.
 * @param {Series[]} group of one chart @returns {{color: string, dash: number[]}[]} */
export function looksOf(group) {
  /** @type {Map<number, number>} */
  const counts = new Map();
  return group.map(({ topic }) => {
    const owner = ownerOf(topic), count = counts.get(owner) ?? 0;
    counts.set(owner, count + 1);
    const color = owner >= 0 ? robotColor(owner) : getComputedStyle(document.documentElement).getPropertyValue("--text").trim();
    return { color, dash: DASHES[count % DASHES.length] };
  });
}

/** The chart of all series of one unit, with their names above it. */
class UnitChart {
  #end = 0;

  /** @param {HTMLElement} area @param {typeof import("../vendor.js").makeChart} make @param {string} unit @param {Series[]} series @param {Plots} plots */
  constructor(area, make, unit, series, plots) {
    this.series = series;
    this.plots = plots;
    this.outputs = series.map(() => el("output", {}));
    const looks = looksOf(series);
    this.chips = el("div", { class: "chips" }, ...series.map((one, i) => this.#chip(one, looks[i], this.outputs[i])));
    this.canvas = el("div");
    this.place = el("div", { class: "chart" }, this.chips, this.canvas);
    area.append(this.place);
    this.chart = make(this.canvas, unit, series.map((one, i) => ({ ...one, ...looks[i] })), () => [Math.max(this.#end - plots.span, Math.min(this.#firstTime(), this.#end - 1)), this.#end], timeText);
  }

  /** @param {Series} series @param {{color: string, dash: number[]}} look @param {HTMLElement} output its newest value */
  #chip({ topic, field }, { color, dash }, output) {
    const swatch = el("span", { class: "swatch" });
    swatch.style.borderTop = `3px ${dash.length ? (dash[0] < 3 ? "dotted" : "dashed") : "solid"} ${color}`;
    const remove = iconButton("close", `Remove ${topic} ${field}`, () => this.plots.remove(topic, field));
    remove.classList.add("plain");
    const owner = ownerOf(topic), short = owner < 0 ? topic : topic.slice(0, topic.indexOf("/"));
    const name = [el("span", { class: "topic" }, short), el("span", { class: "field" }, shorten(field))];
    return el("span", { class: "chip", title: `${topic} ${field}` }, swatch, ...name, output, remove);
  }

  #firstTime() {
    return Math.min(...this.series.map(({ times }) => times[0] ?? Infinity));
  }

  /** @param {number} end s @param {number} height px of the area */
  draw(end, height) {
    this.#end = end;
    const tables = this.series.map((series) => this.plots.recent(end, series));
    const room = height - this.chips.offsetHeight - MARGIN;
    this.chart.draw(tables, Math.max(this.place.clientWidth - MARGIN, 1), Math.max(room, LOWEST));
    tables.forEach(([, values], i) => setText(this.outputs[i], values.length ? formatPlain(Number(values[values.length - 1].toPrecision(4))) : "…"));
  }

  remove() {
    this.chart.remove();
    this.place.remove();
  }
}
