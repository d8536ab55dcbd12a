/** The tree of all frames: where each is in its parent, how old that is, and which process says it. */

import { breakable, el, reconcile, setText } from "../dom.js";
import { formatAge, formatNumber } from "./format.js";

/** @typedef {{name: string, parent: string, x: number, y: number, z: number, yaw: number, static: boolean, age: number | null, by?: string}} Frame */

const OLD = 1; // s: a moving frame older than this is marked
const DEGREE = Math.PI / 180;

/** @param {import("../app.js").App} app @returns {import("./tabs.js").Tab} */
export function framesTab(app) {
  const filter = el("input", { type: "search", class: "grow", placeholder: "Filter", "aria-label": "Filter of frames" });
  const count = el("span", { class: "muted" });
  const headings = el("tr", {}, el("th", { scope: "col" }, "Frame"));
  for (const [text, title] of [["x m", "In its parent"], ["y m", "In its parent"], ["yaw °", "In its parent"], ["Age", ""]]) {
    headings.append(el("th", { scope: "col", class: "number", title }, text));
  }
  headings.append(el("th", { scope: "col" }, "Source"));
  const table = el("table", { id: "frames", "aria-label": "Frames" }, el("thead", {}, headings));
  const empty = el("div", { class: "hint" }, "No frames. ", el("code", {}, "zteam-tf"), " merges them; ", el("code", {}, "zteam up"), " starts it.");
  const loading = el("div", { class: "hint" }, "Loading the frames…");
  const page = el("div", { class: "page" }, el("div", { class: "row" }, filter, count), el("div", { class: "scroll" }, table, loading, empty));
  let shown = false;
  const show = () => {
    if (!shown) return;
    const known = app.store.docs.tf, rows = treeOf(known?.frames ?? []), wanted = filter.value.toLowerCase();
    const fitting = rows.filter(({ frame }) => frame.name.toLowerCase().includes(wanted));
    loading.hidden = Boolean(known);
    empty.hidden = !known || rows.length > 0;
    table.hidden = rows.length === 0;
    setText(count, !known ? "" : wanted ? `${fitting.length} of ${rows.length}` : `${rows.length} frames`);
    reconcile(table, fitting, ({ frame }) => frame.name, createRow, (row, item) => updateRow(row, item, !wanted));
  };
  filter.addEventListener("input", show);
  for (const event of ["tf", "connection"]) app.store.on(event, show);
  const open = (/** @type {boolean} */ on) => {
    if (on !== shown) app.connection.want("tf", on);
    shown = on;
    show();
  };
  return { name: "frames", title: "Frames", page, shown: open };
}

/**
 * Frames in the order of a tree, each below its parent. A parent that no frame describes is a root of its own.
 *
 * @param {Frame[]} frames
 * @returns {{frame: Frame, depth: number}[]}
 */
export function treeOf(frames) {
  /** @type {Map<string, Frame[]>} */
  const children = new Map();
  const known = new Set(frames.map((frame) => frame.name));
  for (const frame of frames) {
    const list = children.get(frame.parent);
    if (list) list.push(frame);
    else children.set(frame.parent, [frame]);
  }
  /** @type {{frame: Frame, depth: number}[]} */
  const rows = [];
  const order = new Intl.Collator(undefined, { numeric: true });
  const add = (/** @type {Frame} */ frame, /** @type {number} */ depth) => {
    rows.push({ frame, depth });
    const below = children.get(frame.name) ?? [];
    for (const child of below.sort((a, b) => order.compare(a.name, b.name))) add(child, depth + 1);
  };
  for (const root of [...children.keys()].filter((name) => !known.has(name)).sort(order.compare)) {
    const bare = { name: root, parent: "", x: NaN, y: NaN, z: NaN, yaw: NaN, static: true, age: null };
    if (root) add(bare, 0);
    else for (const frame of children.get("") ?? []) add(frame, 0);
  }
  return rows;
}

/** @param {{frame: Frame}} item */
function createRow({ frame }) {
  const slash = frame.name.indexOf("/") + 1;
  const prefix = el("span", {}, frame.name.slice(0, slash));
  const row = el("tr", {}, el("td", { class: "key" }, prefix, ...breakable(frame.name.slice(slash))));
  for (let i = 0; i < 4; i++) row.append(el("td", { class: "number" }));
  row.append(el("td", { class: "muted" }));
  return el("tbody", { "data-frame": frame.name }, row);
}

/** @param {HTMLTableSectionElement} rows @param {{frame: Frame, depth: number}} item @param {boolean} tree whether frames are indented */
function updateRow(rows, { frame, depth }, tree) {
  const [name, x, y, yaw, age, by] = rows.rows[0].cells;
  name.style.paddingLeft = `${0.75 + (tree ? 0.75 * depth : 0)}rem`;
  const prefix = name.firstElementChild;
  const again = prefix?.textContent && frame.parent.startsWith(prefix.textContent);
  prefix?.classList.toggle("prefix", Boolean(tree && again));
  name.title = frame.parent ? `${frame.name} in ${frame.parent}` : "root";
  setText(x, formatNumber(frame.x, 2));
  setText(y, formatNumber(frame.y, 2));
  setText(yaw, formatNumber(frame.yaw / DEGREE, 1));
  const root = !Number.isFinite(frame.x);
  setText(age, root ? "" : frame.static ? "static" : formatAge(frame.age));
  age.className = `number ${!frame.static && (frame.age ?? 0) > OLD ? "bad" : "muted"}`;
  setText(by, frame.by ?? "");
}
