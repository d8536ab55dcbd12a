/** A row of tabs with their pages, as WAI-ARIA describes them. */

import { el, iconButton } from "../dom.js";

/**
 * One tab: its page is made at once; `shown` says whether the user sees it.
 * @typedef {{name: string, title: string, page: HTMLElement, shown?: (on: boolean) => void, badge?: HTMLElement}} Tab
 */

export class Tabs {
  /** @type {Tab[]} */
  tabs = [];
  /** The name of the tab that is open, or was open last. */
  current = "";
  open = true;

  /**
   * @param {HTMLElement} place
   * @param {string} what the name of the place, for the button that folds it
   * @param {() => void} changed
   */
  constructor(place, what, changed) {
    this.place = place;
    this.changed = changed;
    this.row = el("div", { role: "tablist", "aria-label": what, onkeydown: (/** @type {KeyboardEvent} */ e) => this.#onKey(e) });
    this.fold = iconButton(what === "Panels" ? "side" : "dock", "", () => this.toggle());
    this.what = what;
    this.body = el("div", { class: "page" });
    place.append(el("div", { class: "tabs" }, this.row, this.fold), this.body);
  }

  /** @param {Tab[]} tabs all that stand here from now on */
  setTabs(tabs) {
    this.tabs = tabs;
    if (!tabs.some((tab) => tab.name === this.current)) this.current = tabs[0]?.name ?? "";
    this.row.replaceChildren(...tabs.map((tab) => this.#button(tab)));
    this.body.replaceChildren(...tabs.map((tab) => tab.page));
    this.#show();
  }

  /** @param {Tab} tab */
  #button(tab) {
    tab.page.id = `page-${tab.name}`;
    tab.page.setAttribute("role", "tabpanel");
    tab.page.setAttribute("aria-labelledby", `tab-${tab.name}`);
    const onclick = () => this.choose(tab.name);
    const button = el("button", { type: "button", role: "tab", id: `tab-${tab.name}`, "aria-controls": tab.page.id, onclick }, tab.title);
    if (tab.badge) button.append(tab.badge);
    return button;
  }

  /** @param {string} name */
  choose(name) {
    if (!this.tabs.some((tab) => tab.name === name)) return;
    this.current = name;
    this.open = true;
    this.#show();
  }

  toggle(open = !this.open) {
    this.open = open;
    this.#show();
  }

  #show() {
    this.place.classList.toggle("closed", !this.open);
    this.body.hidden = !this.open;
    for (const tab of this.tabs) {
      const on = this.open && tab.name === this.current;
      const button = this.row.querySelector(`#tab-${tab.name}`);
      button?.setAttribute("aria-selected", String(on));
      button?.setAttribute("tabindex", tab.name === this.current ? "0" : "-1");
      if (on) button?.scrollIntoView({ block: "nearest", inline: "nearest" });
      tab.page.hidden = !on;
      tab.shown?.(on);
    }
    const label = `${this.open ? "Hide" : "Show"} ${this.what.toLowerCase()}`;
    this.fold.title = label;
    this.fold.setAttribute("aria-label", label);
    this.fold.setAttribute("aria-expanded", String(this.open));
    this.changed();
  }

  /** @param {KeyboardEvent} event */
  #onKey(event) {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    const at = this.tabs.findIndex((tab) => tab.name === this.current);
    this.choose(this.tabs[(at + step + this.tabs.length) % this.tabs.length].name);
    /** @type {HTMLElement | null} */ (this.row.querySelector(`#tab-${this.current}`))?.focus();
  }

  /** @returns {string} the open tab's name, "" while folded */
  get() {
    return this.open ? this.current : "";
  }

  /** @param {string} text as from `get` */
  set(text) {
    if (text) this.choose(text);
    else this.toggle(false);
  }
}
