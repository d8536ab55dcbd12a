/** A message as a tree that keeps what the user has opened while new messages come. */

import { el, reconcile, setText } from "../dom.js";
import { formatPlain, unitOf } from "./format.js";

const OPEN_DEPTH = 4;
const MANY = 12; // items: longer lists are closed at first

export class MessageTree {
  /** @param {(field: string) => void} plot called with the path of a number that was clicked */
  constructor(plot) {
    this.plot = plot;
    this.element = el("div", { class: "tree" });
    /** @type {any} */
    this.message = null;
  }

  clear() {
    this.message = null;
    reconcile(this.element, [], String, () => el("div"), () => {});
  }

  /** @param {any} message parsed JSON */
  show(message) {
    this.message = message;
    this.#fill(this.element, message, "", 0);
  }

  /** @param {HTMLElement} place @param {any} value an object or a list @param {string} path @param {number} depth */
  #fill(place, value, path, depth) {
    const list = Array.isArray(value);
    const entries = Object.entries(typeof value === "object" && value !== null ? value : { value });
    const key = (/** @type {[string, any]} */ [name, child]) => `${name} ${typeof child === "object" && child !== null}`;
    const pathOf = (/** @type {string} */ name) => (list ? `${path}[${name}]` : path ? `${path}.${name}` : name);
    reconcile(place, entries, key, ([name, child]) => this.#create(name, child, pathOf(name), depth), (node, [name, child]) => this.#update(node, child, pathOf(name), depth));
  }

  /** @param {string} name @param {any} value @param {string} path @param {number} depth @returns {HTMLElement} */
  #create(name, value, path, depth) {
    if (typeof value === "object" && value !== null) {
      const size = Object.keys(value).length;
      const branch = el("details", { open: depth < OPEN_DEPTH && size <= MANY }, el("summary", {}, name, el("span", { class: "muted" })), el("div"));
      // What is closed is not kept up to date.
      branch.addEventListener("toggle", () => branch.open && this.message !== null && this.show(this.message));
      return branch;
    }
    const shown = el("span", { class: "leaf" });
    // True is 1 in a plot, false is 0.
    if (typeof value !== "number" && typeof value !== "boolean") return el("div", {}, el("span", { class: "field" }, name), shown);
    const title = `Plot ${path}`;
    const button = el("button", { type: "button", class: "link field", title, "aria-label": title, onclick: () => this.plot(path) }, name);
    return el("div", {}, button, shown, el("span", { class: "muted" }, unitOf(path)));
  }

  /** @param {HTMLElement} node @param {any} value @param {string} path @param {number} depth */
  #update(node, value, path, depth) {
    if (node instanceof HTMLDetailsElement) {
      const [summary, place] = node.children;
      if (Array.isArray(value)) setText(/** @type {Element} */ (summary.lastElementChild), `[${value.length}]`);
      if (node.open) this.#fill(/** @type {HTMLElement} */ (place), value, path, depth + 1);
      return;
    }
    setText(node.children[1], typeof value === "number" ? formatPlain(value) : JSON.stringify(value) ?? "");
  }
}
