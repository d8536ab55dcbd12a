/** The parameters of a robot's behaviour, each with a control of its type. A refused value says why, in its place. */

import { el, reconcile, setText } from "../dom.js";
import { whyNoCommand } from "../rights.js";

/** @typedef {{name: string, type: string, limits: Record<string, any>, description: string, required: boolean, default: any}} Parameter
 *  as the robot's process describes it */
/** @typedef {HTMLInputElement | HTMLSelectElement} Control */
/** @typedef {HTMLElement & {control: Control, problem: HTMLElement, known: string, old: string, oldUntil: number}} Row
 *  known: what the robot says, as the control shows it; old: what it said before the page set another value */

const UNDER_WAY = 3000; // ms: what a robot said before may still be under way

export class ParameterList {
  #robot = -1;

  /** @param {import("../app.js").App} app */
  constructor(app) {
    this.app = app;
    this.hint = el("div", { class: "hint" });
    this.rows = el("div", { class: "parameters" });
    this.element = el("div", {}, this.hint, this.rows);
  }

  /** @param {number} robot @param {{behavior?: string, parameters?: Parameter[], values?: Record<string, any>}} told */
  show(robot, { behavior, parameters, values }) {
    const why = whyNoCommand(this.app.store);
    this.#robot = robot;
    setText(this.hint, hintOf(behavior, parameters, why));
    this.hint.hidden = this.hint.textContent === "";
    reconcile(this.rows, parameters ?? [], ({ name, type }) => `${robot} ${behavior} ${name} ${type}`, (one) => this.#create(one), (row, { name, type }) => {
      row.control.disabled = why !== "";
      row.control.title = why;
      update(row, textOf(values?.[name], type));
    });
  }

  /** @param {Parameter} parameter @returns {Row} */
  #create(parameter) {
    const { name, description } = parameter, robot = this.#robot, id = `parameter-${name}`;
    const control = controlOf(parameter), problem = el("div", { class: "problem", role: "alert", id: `${id}-problem` });
    control.id = id;
    control.setAttribute("aria-describedby", `${id}-about ${id}-problem`);
    const label = el("label", { for: id, class: "key" }, name);
    const about = [description, rangeOf(parameter.limits), `default ${parameter.default === null ? "none" : textOf(parameter.default, parameter.type)}`];
    const row = el("div", { "data-parameter": name }, label, control, el("div", { class: "about", id: `${id}-about` }, about.filter(Boolean).join("; ")), problem);
    const whole = Object.assign(row, { control, problem, known: "", old: "", oldUntil: 0 });
    control.addEventListener("change", () => this.#set(robot, whole, parameter));
    return whole;
  }

  /** @param {number} robot @param {Row} row @param {Parameter} parameter */
  async #set(robot, row, { name, type }) {
    const shown = shownIn(row.control);
    const value = type === "str" ? JSON.stringify(shown) : shown;
    const error = value === "" ? "give a value" : await this.app.send({ op: "parameter", robot, name, value });
    // The robot's own name, behaviour and parameter are in the row already.
    const text = error.replace(/^robot_\d+: (behaviour [^:]*: )?/, "").replace(`${name}: `, "");
    setText(row.problem, text ? `refused: ${text}` : "");
    row.control.setAttribute("aria-invalid", String(text !== ""));
    // A refused value stays for the user to mend; another one is shown as soon as the robot says it.
    if (text) return;
    row.old = row.known;
    row.oldUntil = performance.now() + UNDER_WAY;
    row.known = shown;
  }
}

/** @param {string | undefined} behavior @param {Parameter[] | undefined} parameters @param {string} why */
function hintOf(behavior, parameters, why) {
  if (!parameters) return "No process of the robot tells its parameters.";
  if (!parameters.length) return `The behaviour ${behavior} takes no parameters.`;
  return why ? `To change them: ${why}.` : "";
}

/** Shows what the robot says, unless it is what it said before: the user may be writing. @param {Row} row @param {string} text */
function update(row, text) {
  if (row.known === text || (row.old === text && performance.now() < row.oldUntil)) return;
  row.known = text;
  if (row.control instanceof HTMLInputElement && row.control.type === "checkbox") row.control.checked = text === "true";
  else row.control.value = text;
  setText(row.problem, "");
  row.control.setAttribute("aria-invalid", "false");
}

/** @param {Control} control */
function shownIn(control) {
  return control instanceof HTMLInputElement && control.type === "checkbox" ? String(control.checked) : control.value.trim();
}

/** A value as it is typed. @param {any} value @param {string} type */
function textOf(value, type) {
  if (value === null || value === undefined) return "";
  if (typeof value === "string") return type.startsWith("'") ? JSON.stringify(value) : value;
  return JSON.stringify(value);
}

/** @param {Parameter} parameter @returns {Control} */
function controlOf({ type, limits }) {
  if (type === "bool") return el("input", { type: "checkbox" });
  const choices = [...type.matchAll(/'([^']*)'/g)].map(([, choice]) => JSON.stringify(choice));
  if (choices.length) return el("select", {}, ...choices.map((choice) => el("option", { value: choice }, JSON.parse(choice))));
  if (!/^(int|float)( \| None)?$/.test(type)) return el("input", { type: "text", spellcheck: "false", placeholder: type });
  // The robot says what is out of bounds: the control only helps.
  const step = type.startsWith("int") ? limits.multiple_of ?? 1 : "any";
  return el("input", { type: "number", step, min: limits.ge ?? limits.gt ?? null, max: limits.le ?? limits.lt ?? null });
}

/** @param {Record<string, any>} limits by the names of msgspec.Meta */
function rangeOf(limits) {
  const words = { ge: "≥", gt: ">", le: "≤", lt: "<", multiple_of: "a multiple of", pattern: "like", min_length: "length ≥", max_length: "length ≤" };
  const number = (/** @type {any} */ value) => (typeof value === "number" ? Number(value.toPrecision(5)) : value);
  return Object.entries(words).flatMap(([name, word]) => (name in limits ? [`${word} ${number(limits[name])}`] : [])).join(" and ");
}
