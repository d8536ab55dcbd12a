/** The simulator's controls: a few in the tool bar, all of them on a page of the panels. */

import { confirmButton, drawIcon, el, iconButton, setAttribute, setText } from "../dom.js";
import { formatClock, formatNumber } from "./format.js";
import { showFacts } from "./inspector.js";
import { whyNoCommand } from "../rights.js";

/** Simulated seconds a second of the host; 0: as fast as possible. */
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 0];
const CLOCK_PERIOD = 100; // ms

/** @param {import("../store.js").Store} store @returns {string} why the world cannot be commanded; "" if it can */
function whyNot(store) {
  return whyNoCommand(store) || (store.team?.sim.present ? "" : "there is no simulator");
}

/** @param {number} factor */
const speedText = (factor) => (factor === 0 ? "max" : `${factor} ×`);

/** Pause, step, speed, clock and real-time factor in the tool bar. @param {import("../app.js").App} app */
export function mountSimulatorBar(app) {
  const { store } = app;
  const place = /** @type {HTMLElement} */ (document.getElementById("sim"));
  const pause = iconButton("pause", "Pause", () => {
    const stands = store.team?.sim.state === "paused";
    app.ask({ op: stands ? "resume" : "pause" }, stands ? "Resume" : "Pause");
  });
  const step = iconButton("step", "One tick", () => app.ask({ op: "step", ticks: 1 }, "Step"));
  const speed = speedSelect(app, SPEEDS, "speed", () => [whyNot(store), store.team?.sim.present ? store.team.sim.speed ?? 0 : 1]);
  const clock = el("span", { class: "value", title: "Simulated time" }), factor = el("span", { class: "value", title: "Real-time factor: simulated seconds a second" });
  place.append(pause, step, speed.select, clock, factor);
  const badge = el("div", { id: "stands", role: "status" });
  document.getElementById("scene")?.after(badge);
  const show = () => {
    const sim = store.team?.sim, why = whyNot(store), stands = sim?.state === "paused";
    const name = stands ? "play" : "pause", label = stands ? "Resume" : "Pause";
    if (pause.dataset.icon !== name) pause.replaceChildren(drawIcon(name));
    pause.dataset.icon = name;
    setAttribute(pause, "aria-label", label);
    pause.classList.toggle("on", stands);
    for (const [button, text] of /** @type {const} */ ([[pause, label], [step, "One tick, then stand still"]])) {
      button.disabled = why !== "";
      button.title = why ? `${text}: ${why}` : text;
    }
    speed.show();
    setText(factor, factorText(sim));
    setText(badge, sim?.present && sim.state !== "running" ? sim.state.toUpperCase() : "");
  };
  for (const event of ["team", "connection"]) store.on(event, show);
  showClock(store, clock);
  show();
}

/** @param {any} sim of the team's document @returns {string} a world that stands has no factor */
const factorText = (sim) => (sim?.present && sim.state === "running" ? `${formatNumber(sim.rtf, 2)} ×` : "–");

/** @param {import("../store.js").Store} store @param {HTMLElement} node */
function showClock(store, node) {
  let last = 0;
  const show = () => {
    const now = performance.now();
    if (now - last < CLOCK_PERIOD) return;
    last = now;
    setText(node, store.frame.number < 0 ? "–" : formatClock(store.frame.stamp));
  };
  store.on("frame", show);
  show();
}

/**
 * @param {import("../app.js").App} app @param {number[]} factors @param {string} op that sets one of them
 * @param {() => [string, number]} look why it cannot be set, "" if it can; and the one of now
 */
export function speedSelect(app, factors, op, look) {
  const select = el("select", { "aria-label": "Speed" }, ...factors.map((factor) => el("option", { value: factor }, speedText(factor))));
  select.addEventListener("change", () => {
    // With the keys the next choice may follow; after the mouse, keys are meant for the map.
    if (!select.matches(":focus-visible")) select.blur();
    app.ask({ op, factor: Number(select.value) }, "Speed");
  });
  const show = () => {
    const [why, factor] = look(), current = String(factor);
    select.disabled = why !== "";
    select.title = why ? `Speed: ${why}` : "Speed: simulated seconds a second";
    if (document.activeElement === select) return;
    if (![...select.options].some((option) => option.value === current)) select.append(el("option", { value: current }, speedText(Number(current))));
    select.value = current;
  };
  return { select, show };
}

/** @param {import("../app.js").App} app @returns {import("./tabs.js").Tab} */
export function simulatorTab(app) {
  const { store } = app;
  const facts = el("dl", { class: "facts" });
  const parts = [stepRow(app), spawnRow(app), resetRow(app)];
  const why = el("div", { class: "hint", role: "note" });
  const page = el("div", { class: "page" }, el("div", { class: "scroll" }, facts, ...parts.map((part) => part.element), why));
  let shown = false;
  const show = () => {
    if (!shown) return;
    showFacts(facts, factsOf(store));
    const reason = whyNot(store);
    setText(why, reason ? `These need the right to command a simulator; ${reason}.` : "");
    for (const part of parts) part.show(reason);
  };
  for (const event of ["team", "connection", "tool", "frame"]) store.on(event, show);
  return { name: "simulator", title: "Simulator", page, shown: (on) => { shown = on; show(); } };
}

/** @param {import("../store.js").Store} store @returns {[string, string][]} */
function factsOf({ team, frame }) {
  const sim = team?.sim;
  if (!team) return [["State", "loading…"]];
  /** @type {[string, string]} */
  const namespace = ["Namespace", team.namespace || "none"];
  if (!sim?.present) return [["State", team.loading ? "loading…" : "there is no simulator"], namespace];
  const waits = sim.waits_for ? `, waits for ${sim.waits_for}` : "";
  return [
    ["State", sim.state],
    ["Simulated time", `${formatClock(frame.stamp)}, tick ${frame.tick}`],
    ["Speed", sim.speed ? speedText(sim.speed) : "as fast as possible"],
    ["Real-time factor", factorText(sim)],
    ["Lock-step", sim.lockstep ? `on${waits}` : "off: real time"],
    ["Start gate", team.gate.text],
    namespace,
  ];
}

/** @param {import("../app.js").App} app */
function stepRow(app) {
  const ticks = el("input", { type: "number", min: 1, max: 1000000, value: 10, "aria-label": "Ticks" });
  const button = el("button", { type: "button", onclick: () => app.ask({ op: "step", ticks: ticks.valueAsNumber || 1 }, "Step") }, "Step");
  const element = el("div", { class: "row" }, el("span", { class: "label" }, "Ticks"), ticks, button);
  return { element, show: (/** @type {string} */ why) => setDisabled([ticks, button], why) };
}

/** @param {import("../app.js").App} app */
function spawnRow(app) {
  const { store } = app;
  const model = el("select", { "aria-label": "Model of the new robot" });
  const behavior = el("select", { "aria-label": "Behaviour of the new robot" });
  const button = el("button", { type: "button", onclick: () => place() }, "Place in the map");
  const place = () => {
    if (app.tool === "spawn") return app.useTool("select");
    choose();
    app.useTool("spawn");
    return app.say(`Click where the ${model.value} should stand; drag for its heading. Esc ends this.`);
  };
  const choose = () => {
    app.spawnModel = model.value;
    app.spawnBehavior = behavior.value;
  };
  for (const list of [model, behavior]) list.addEventListener("change", choose);
  const element = el("div", { class: "row" }, el("span", { class: "label" }, "New robot"), model, behavior, button);
  const show = (/** @type {string} */ why) => {
    const models = store.team?.sim.models ?? [];
    const launcher = store.team?.launcher;
    offer(model, models);
    offer(behavior, ["", ...(launcher ? store.team?.behaviors ?? [] : [])]);
    setAttribute(button, "aria-pressed", app.tool === "spawn" ? "true" : null);
    setDisabled([model, button], why || (models.length ? "" : "the world's file has no models of robots"));
    setDisabled([behavior], why || (launcher ? "" : "behaviours are started by zteam up, which is not there"));
  };
  return { element, show };
}

/** Makes these the choices of a list, unless they are. @param {HTMLSelectElement} list @param {string[]} names "": none */
function offer(list, names) {
  if (list.options.length === names.length && names.every((name, i) => list.options[i].value === name)) return;
  const chosen = list.value;
  list.replaceChildren(...names.map((name) => el("option", { value: name }, name || "no behaviour")));
  if (names.includes(chosen)) list.value = chosen;
}

/** @param {import("../app.js").App} app */
function resetRow(app) {
  const button = confirmButton("Reset the world", "Click again to reset", () => app.ask({ op: "reset" }, "Reset"));
  button.classList.add("danger");
  const element = el("div", { class: "row" }, el("span", { class: "label" }, "Begin again"), button);
  return { element, show: (/** @type {string} */ why) => setDisabled([button], why) };
}

/** @param {(HTMLButtonElement | HTMLInputElement | HTMLSelectElement)[]} controls @param {string} why */
function setDisabled(controls, why) {
  for (const control of controls) {
    control.disabled = why !== "";
    control.title = why;
  }
}
