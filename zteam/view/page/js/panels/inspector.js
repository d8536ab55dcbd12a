/** All of one robot, the selected one: pose and its source, goal, plots, sensors, parameters, log. */

import { progressText } from "../goals.js";
import { robotColor } from "../robot_colors.js";
import { el, reconcile, setAttribute, setText } from "../dom.js";
import { formatAge, formatNumber } from "./format.js";
import { drawLine } from "./log.js";
import { ParameterList } from "./parameters.js";
import { behaviorOf, stateOf } from "./team.js";

const LOG_ROWS = 8;
const OLD_READING = 2; // s

/** @typedef {{topic: string, type: string, hz: number, age: number}} Sensor */
/** @typedef {{frame: string, parent: string, by: string}} Link by: the process that says where frame is in parent */
/** @typedef {{robot: number, behavior?: string, parameters?: import("./parameters.js").Parameter[], values?: Record<string, any>, sensors: Sensor[], frames: Link[]}} Inspection */
/** @typedef {{plot: (topic: string, field: string) => void, isPlotted: (topic: string, field: string) => boolean, echo: (topic: string) => void, log: (process: string) => void}} Ways to other panels */

/** What is plotted by one click, where the robot has the sensor. */
const PLOTS = [
  { title: "Speed", sensor: "odom", field: "twist.twist.linear.x" },
  { title: "Turn rate", sensor: "odom", field: "twist.twist.angular.z" },
  { title: "Distance to obstacle", sensor: "base_scan", field: "min(ranges)" },
  { title: "Sonar", sensor: "sonar_0", field: "range" },
];

/** @param {import("../app.js").App} app @param {Ways} ways @returns {import("./tabs.js").Tab} */
export function inspectorTab(app, ways) {
  const inspector = new Inspector(app, ways);
  return { name: "robot", title: "Robot", page: inspector.page, shown: (on) => inspector.open(on) };
}

class Inspector {
  #shown = false;

  /** @param {import("../app.js").App} app @param {Ways} ways */
  constructor(app, ways) {
    this.app = app;
    this.ways = ways;
    this.swatch = el("span", { class: "swatch" });
    this.name = el("strong", { class: "grow" });
    const follow = el("button", { type: "button", onclick: () => app.camera.set({ follow: this.#id }) }, "Follow");
    this.hint = el("div", { class: "hint" }, "Select a robot in the map or in the table to see its details.");
    this.facts = el("dl", { class: "facts" });
    this.plots = el("div", { class: "row" });
    this.sensors = el("table", { id: "sensors", "aria-label": "Sensors" }, el("thead", {}, headings(["Sensor", "Type"], ["Hz", "Age"])));
    this.noSensors = el("div", { class: "hint" }, "No message has come from it yet.");
    this.parameters = new ParameterList(app);
    this.lines = el("div", { class: "log", role: "log", "aria-label": "Log of the robot", "aria-live": "off" });
    const allLines = el("button", { type: "button", class: "link", onclick: () => ways.log(`robot_${this.#id}`) }, "All lines");
    this.body = el("div", { class: "scroll" },
      this.facts,
      el("h3", {}, "Plot"), this.plots,
      el("h3", {}, "Sensors"), this.sensors, this.noSensors,
      el("h3", {}, "Parameters"), this.parameters.element,
      el("h3", {}, "Log ", allLines), this.lines);
    this.head = el("div", { class: "row under" }, this.swatch, this.name, follow);
    this.page = el("div", { class: "page" }, this.hint, this.head, this.body);
    for (const event of ["team", "goals", "inspect", "selection", "connection", "theme", "plots"]) app.store.on(event, () => this.#show());
    app.store.on("robots", () => this.#showFacts());
    for (const event of ["log", "selection"]) app.store.on(event, () => this.#showLog());
  }

  /** The selected robot with the lowest id, as the server has it too; -1 for none. */
  get #id() {
    return this.app.store.selection.size ? Math.min(...this.app.store.selection) : -1;
  }

  /** What the server has said of it. @returns {Inspection} */
  get #known() {
    const { inspect } = this.app.store.docs, id = this.#id;
    return inspect?.robot === id ? inspect : { robot: id, sensors: [], frames: [] };
  }

  /** @param {boolean} on */
  open(on) {
    if (on !== this.#shown) this.app.connection.want("inspect", on);
    this.#shown = on;
    this.#show();
    this.#showLog();
  }

  #show() {
    if (!this.#shown) return;
    const { store } = this.app, id = this.#id, robot = store.robots.get(id);
    this.hint.hidden = id >= 0;
    this.head.hidden = this.body.hidden = id < 0;
    if (id < 0) return;
    const known = this.#known;
    this.swatch.style.backgroundColor = robotColor(id);
    setText(this.name, robot?.name || `robot_${id}`);
    this.#showFacts();
    this.#showPlots(known.sensors);
    this.sensors.hidden = known.sensors.length === 0;
    this.noSensors.hidden = !this.sensors.hidden;
    reconcile(this.sensors, known.sensors, ({ topic }) => topic, ({ topic }) => sensorRow(topic, this.ways.echo), updateSensor);
    this.parameters.show(id, known);
  }

  #showFacts() {
    if (this.#shown && this.#id >= 0) showFacts(this.facts, factsOf(this.app.store, this.#id, this.#known));
  }

  /** @param {Sensor[]} sensors */
  #showPlots(sensors) {
    const found = PLOTS.flatMap((plot) => {
      const source = sensors.find(({ topic }) => topic.endsWith(`/${plot.sensor}`));
      return source ? [{ ...plot, topic: source.topic }] : [];
    });
    reconcile(this.plots, found, ({ topic, field }) => `${topic}:${field}`, ({ title, topic, field }) => {
      const onclick = () => this.ways.plot(topic, field);
      return el("button", { type: "button", title: `Plot ${field} of ${topic}`, onclick }, title);
    }, (button, { topic, field }) => setAttribute(button, "aria-pressed", String(this.ways.isPlotted(topic, field))));
  }

  #showLog() {
    if (!this.#shown) return;
    const lines = this.app.store.log.filter((line) => isAbout(line, this.#id)).slice(-LOG_ROWS);
    this.lines.replaceChildren(...(lines.length ? lines.map(drawLine) : [el("div", { class: "hint" }, "It has logged nothing yet.")]));
  }
}

/** Whether a robot or its navigation logs a line; one process may navigate for all robots, and names the one it means.
 * @param {import("./log.js").Line} line @param {number} id */
export function isAbout({ process, text }, id) {
  if (!/^nav_\d+$/.test(process)) return process === `robot_${id}`;
  const named = text.match(/\brobot_\d+\b/g);
  return named ? named.includes(`robot_${id}`) : process === `nav_${id}`;
}

/** @param {string[]} texts @param {string[]} numbers */
function headings(texts, numbers) {
  const cells = texts.map((text) => el("th", { scope: "col" }, text));
  return el("tr", {}, ...cells, ...numbers.map((text) => el("th", { scope: "col", class: "number" }, text)));
}

/** @param {HTMLElement} place @param {[string, string][]} facts */
export function showFacts(place, facts) {
  reconcile(place, facts, ([name]) => name, ([name]) => el("div", {}, el("dt", {}, name), el("dd")), (node, [, text]) => {
    setText(/** @type {Element} */ (node.lastElementChild), text);
  });
}

/** @param {import("../store.js").Store} store @param {number} id @param {Inspection} known @returns {[string, string][]} */
function factsOf(store, id, known) {
  const robot = store.robots.get(id), pose = store.poses.at(id);
  const goal = (store.docs.goals ?? []).find((/** @type {import("../goals.js").Goal} */ one) => one.robot === id);
  const does = robot ? [stateOf(robot, store.team), robot.reason].filter(Boolean).join(": ") : "unknown";
  return [
    ["State", does],
    ["Behaviour", robot ? behaviorOf({ ...robot, behavior: known.behavior ?? robot.behavior }) : known.behavior ?? "–"],
    ["Pose in map", pose ? poseText(pose) : "not known"],
    ["Source", pose?.truth ? "the simulator: it has no transforms" : sourceText(known.frames)],
    ["Goal", goal ? [poseText(goal), progressText(goal), goal.text].filter(Boolean).join("; ") : "none"],
    ["Model", robot?.model || "–"],
  ];
}

/** @param {{x: number, y: number, yaw: number}} pose */
function poseText({ x, y, yaw }) {
  return `${formatNumber(x, 2)} m, ${formatNumber(y, 2)} m, ${formatNumber((180 * yaw) / Math.PI, 0)}°`;
}

/** Which process says where which frame is, from the map down to the robot. @param {Link[]} frames */
function sourceText(frames) {
  if (!frames.length) return "not known: no aggregator of transforms answers";
  return [...frames].reverse().map(({ frame, by }) => `${frame.split("/").at(-1)} by ${by}`).join(", ");
}

/** @param {string} topic @param {(topic: string) => void} echo */
function sensorRow(topic, echo) {
  const name = topic.split("/").slice(1).join("/");
  const button = el("button", { type: "button", class: "link", title: `Show the newest message of ${topic}`, onclick: () => echo(topic) }, name);
  const row = el("tr", {}, el("td", { class: "key" }, button), el("td", { class: "muted" }), el("td", { class: "number" }), el("td"));
  return el("tbody", { "data-topic": topic }, row);
}

/** @param {HTMLTableSectionElement} rows @param {Sensor} sensor */
function updateSensor(rows, { type, hz, age }) {
  const [, kind, rate, old] = rows.rows[0].cells;
  setText(kind, type.split("/").at(-1) ?? "");
  setText(rate, formatNumber(hz, hz < 10 ? 1 : 0));
  setText(old, formatAge(age));
  old.className = `number ${age > OLD_READING ? "bad" : "muted"}`;
}
