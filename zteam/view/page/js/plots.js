/** Numbers over time: which fields are plotted, what has come of them, and one chart for each unit. */

import { unitOf } from "./panels/format.js";

export const SPANS = [10, 30, 60, 300]; // s
const MOST_POINTS = 20000; // of one series

/** @typedef {{topic: string, field: string, unit: string, times: number[], values: number[]}} Series */

/** The series of the plots. Times are seconds of the team's clock. */
export class Plots {
  /** @type {Series[]} */
  series = [];
  span = SPANS[1];

  /**
   * @param {{watch: (topic: string, field: string) => void, unwatch: (topic: string, field: string) => void}} connection
   * @param {() => void} changed the set of series is another one
   */
  constructor(connection, changed) {
    this.connection = connection;
    this.changed = changed;
  }

  /** @param {string} topic @param {string} field */
  has(topic, field) {
    return this.#find(topic, field) !== undefined;
  }

  /** @param {string} topic @param {string} field */
  #find(topic, field) {
    return this.series.find((one) => one.topic === topic && one.field === field);
  }

  /** @param {string} topic @param {string} field */
  add(topic, field) {
    if (this.#find(topic, field)) return;
    this.series.push({ topic, field, unit: unitOf(field), times: [], values: [] });
    this.connection.watch(topic, field);
    this.changed();
  }

  /** @param {string} topic @param {string} field */
  remove(topic, field) {
    const series = this.#find(topic, field);
    if (!series) return;
    this.series.splice(this.series.indexOf(series), 1);
    this.connection.unwatch(topic, field);
    this.changed();
  }

  /** Forgets what has come; the series stay. */
  clear() {
    for (const series of this.series) series.times.length = series.values.length = 0;
  }

  /** @param {{topic: string, field: string, times: Float64Array, values: Float64Array}} samples */
  take({ topic, field, times, values }) {
    const series = this.#find(topic, field);
    if (!series) return;
    for (let i = 0; i < times.length; i++) {
      const last = series.times.length ? series.times[series.times.length - 1] : -Infinity;
      // A world that begins again begins a new curve.
      if (times[i] < last) series.times.length = series.values.length = 0;
      if (times[i] === last) series.values[series.values.length - 1] = values[i];
      else {
        series.times.push(times[i]);
        series.values.push(values[i]);
      }
    }
    const many = series.times.length - MOST_POINTS;
    if (many > MOST_POINTS / 10) {
      series.times.splice(0, many);
      series.values.splice(0, many);
    }
  }

  /** @returns {Map<string, Series[]>} series by unit: those of one unit share a chart */
  byUnit() {
    /** @type {Map<string, Series[]>} */
    const groups = new Map();
    for (const series of this.series) groups.set(series.unit, [...(groups.get(series.unit) ?? []), series]);
    return groups;
  }

  /** @param {number} now s @param {Series} series @returns {[number[], number[]]} times and values within the span before `now` */
  recent(now, series) {
    const start = firstAfter(series.times, now - this.span);
    return [series.times.slice(start), series.values.slice(start)];
  }

  /** @returns {string} as `set` takes it */
  get() {
    return this.series.map(({ topic, field }) => `${topic}:${field}`).join(",");
  }

  /** @param {string} text */
  set(text) {
    for (const { topic, field } of [...this.series]) this.remove(topic, field);
    for (const one of text.split(",")) {
      const [topic, field] = one.split(":");
      if (topic && field) this.add(topic, field);
    }
  }
}

/** @param {number[]} times ascending @param {number} start @returns {number} the first place at or after `start` */
export function firstAfter(times, start) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < start) low = middle + 1;
    else high = middle;
  }
  return low;
}
