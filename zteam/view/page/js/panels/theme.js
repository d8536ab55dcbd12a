/** Dark or light: as the system has it, until the user chooses. */

import { keep, recall } from "../kept.js";

const KEY = "zteam-theme";
const CHOICES = ["auto", "dark", "light"];

export class Theme {
  #dark = matchMedia("(prefers-color-scheme: dark)");

  /** @param {import("../store.js").Store} store hears "theme" after each change */
  constructor(store) {
    this.store = store;
    this.choice = "auto";
    this.#dark.addEventListener("change", () => this.#show());
    this.set(recall(KEY) || "auto");
  }

  get() {
    return this.choice;
  }

  /** @param {string} choice auto, dark or light */
  set(choice) {
    if (!CHOICES.includes(choice)) return;
    this.choice = choice;
    this.#show();
  }

  /** The other one, and this browser's from now on. */
  toggle() {
    this.set(this.shown === "dark" ? "light" : "dark");
    keep(KEY, this.choice);
  }

  get shown() {
    if (this.choice === "auto") return this.#dark.matches ? "dark" : "light";
    return this.choice;
  }

  #show() {
    document.documentElement.dataset.theme = this.shown;
    this.store.emit("theme");
  }
}
