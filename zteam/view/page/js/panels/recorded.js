/** The time line of a recording, at the foot of the page while one is shown instead of a team; and its keys. */

import { drawIcon, el, iconButton, setAttribute, setText } from "../dom.js";
import { whyNoRight } from "../rights.js";
import { isOnControl, isTyped } from "../tools/keys.js";
import { formatTime } from "./format.js";
import { speedSelect } from "./simulator.js";

/** Seconds of the recording a second of the host. */
const SPEEDS = [0.25, 0.5, 1, 2, 5, 10];
/** ms between two jumps, or steps, at least. */
const PERIOD = 100;

/** Seconds of the recording, or where it has no simulated time the host's time of day. @param {number} seconds */
function timeText(seconds) {
  const text = formatTime(seconds);
  return text.includes(":") ? text : `${text} s`;
}

/**
 * Has an act done with a value, one after another and ten times a second at most. What is given meanwhile is merged.
 * @param {(value: number) => Promise<unknown>} act
 * @param {(waiting: number, value: number) => number} merge
 */
function inTurn(act, merge) {
  /** @type {number | null} */
  let waiting = null;
  const turns = { busy: false, give };
  /** @param {number} value */
  async function give(value) {
    waiting = waiting === null ? value : merge(waiting, value);
    if (turns.busy) return;
    turns.busy = true;
    while (waiting !== null) {
      const next = waiting;
      waiting = null;
      await Promise.all([act(next), new Promise((done) => setTimeout(done, PERIOD))]);
    }
    turns.busy = false;
  }
  return turns;
}

/** @param {import("../app.js").App} app */
export function mountRecorded(app) {
  const { store } = app;
  const status = () => store.docs.replay;
  const start = () => status().start / 1e9, end = () => status().end / 1e9;
  const jumps = inTurn((time) => app.ask({ op: "replay_seek", time }, "Jump"), (_, newest) => newest);
  const steps = inTurn((ticks) => app.ask({ op: "replay_step", ticks }, "Step"), (sum, ticks) => sum + ticks);
  const file = el("span", { class: "file" }), time = el("span", { class: "value" }), tick = el("span", { class: "muted mono" });
  const back = iconButton("back", "A tick back", () => steps.give(-1)), on = iconButton("step", "A tick on", () => steps.give(1));
  const play = iconButton("play", "Play", () => toggle());
  const slider = el("input", { type: "range", min: 0, step: "any", "aria-label": "Time of the recording" });
  slider.addEventListener("input", () => jump(start() + slider.valueAsNumber));
  const speed = speedSelect(app, SPEEDS, "replay_speed", () => [whyNoRight(store), status().speed]);
  const bar = el("section", { id: "recorded", "aria-label": "Recording", hidden: true }, el("strong", {}, "RECORDED"), file, back, play, on, slider, time, tick, speed.select);
  document.getElementById("status")?.before(bar);

  const toggle = () => app.ask({ op: status().is_paused ? "replay_resume" : "replay_pause" }, status().is_paused ? "Play" : "Pause");
  /** Shown at once; the page follows. @param {number} seconds */
  function jump(seconds) {
    const inside = Math.min(Math.max(seconds, start()), end());
    place(inside);
    jumps.give(inside);
  }

  /** @param {number} seconds */
  function place(seconds) {
    if (!slider.matches(":active")) slider.valueAsNumber = seconds - start();
    setText(time, timeText(seconds));
    setAttribute(slider, "aria-valuetext", `${timeText(seconds)} of ${timeText(end())}`);
  }

  function show() {
    const replay = status(), why = whyNoRight(store);
    bar.hidden = !replay;
    document.body.classList.toggle("recorded", !bar.hidden);
    if (!replay) return;
    setText(file, replay.file.split("/").at(-1));
    file.title = replay.file;
    setAttribute(slider, "max", String(end() - start()));
    // The slider must not change its size under the pointer.
    time.style.minWidth = `calc(${timeText(end()).length}ch + .75rem)`;
    tick.style.minWidth = `${`tick ${replay.ticks} of ${replay.ticks}`.length}ch`;
    // What the user has chosen holds until the recording is there.
    if (!jumps.busy && !slider.matches(":active")) place(replay.now / 1e9);
    setText(tick, `tick ${replay.tick} of ${replay.ticks}`);
    const name = replay.is_paused ? "play" : "pause", label = replay.is_paused ? "Play" : "Pause";
    if (play.dataset.icon !== name) play.replaceChildren(drawIcon(name));
    play.dataset.icon = name;
    for (const [button, text] of /** @type {const} */ ([[play, label], [back, "A tick back"], [on, "A tick on"], [slider, "Time"]])) {
      button.disabled = why !== "";
      button.title = why ? `${text}: ${why}` : text;
    }
    setAttribute(play, "aria-label", label);
    speed.show();
  }
  for (const event of ["replay", "connection"]) store.on(event, show);
  show();

  const shown = () => start() + slider.valueAsNumber;
  /** @type {Record<string, () => void>} */
  const keys = {
    " ": toggle,
    ArrowLeft: () => steps.give(-1),
    ArrowRight: () => steps.give(1),
    "Shift+ArrowLeft": () => jump(shown() - 1),
    "Shift+ArrowRight": () => jump(shown() + 1),
    Home: () => jump(start()),
    End: () => jump(end()),
  };
  // Before the keys of the map, which listen to the window.
  document.addEventListener("keydown", (event) => {
    const { key, shiftKey, target } = event, act = keys[`${shiftKey ? "Shift+" : ""}${key}`];
    if (!act || !store.isRecorded || event.defaultPrevented || isTyped(event) || event.ctrlKey || event.altKey || event.metaKey) return;
    // The map with the focus has a cursor, and controls have keys of their own.
    if (target !== slider && (isOnControl(event) || (target instanceof Element && target.id === "map"))) return;
    event.preventDefault();
    if (!event.repeat || act !== toggle) act();
  });
}
