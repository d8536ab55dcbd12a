/** The page as one object, which every part gets. */

import { Connection, takeToken } from "./connection.js";
import { Layers } from "./layers.js";
import { Camera } from "./scene/camera.js";
import { Store } from "./store.js";
import { chosenRobots } from "./tools/pose.js";

const BEAMS = 1081;
const MANY_ROBOTS = 8;
const BEAMS_OF_MANY = 360;

/**
 * Metres and radians are sent in steps of 0.1 mm: a server repeats them in what it says.
 * @param {Record<string, any>} command
 */
function rounded(command) {
  const entries = Object.entries(command).map(([name, value]) => [
    name,
    typeof value === "number" ? Math.round(1e4 * value) / 1e4 : value,
  ]);
  return Object.fromEntries(entries);
}

/** @typedef {{text: string, level: "info" | "error", about?: string}} Said about: a newer one about the same takes its place */

/** What the parts of the page share. */
export class App {
  constructor() {
    this.store = new Store();
    this.layers = new Layers(this.store);
    this.camera = new Camera(() => this.store.emit("camera", this.camera));
    this.connection = new Connection(this.store, () => this.#looksAt(), takeToken());
    /** What was said before the panels came, which show it; null from then on. @type {Said[] | null} */
    this.unsaid = [];
    /** The name of the tool that takes the mouse: select, goal, pose, move, measure, spawn. */
    this.tool = "select";
    /** Opens the panel with all of one robot. @type {(robot: number) => void} */
    this.inspect = () => {};
    /** The model that the tool "spawn" makes. */
    this.spawnModel = "";
    /** The behaviour that it gets; "" for none. */
    this.spawnBehavior = "";
    /** @type {import("./scene/scene.js").Scene | null} */
    this.scene = null;
    /** @type {import("./drive/driver.js").Driver | null} */
    this.drive = null;
  }

  /** @param {object} command without `seq` @returns {Promise<string>} why it was refused; "" if it was carried out */
  send(command) {
    return this.connection.send(rounded(command));
  }

  /** The same, and the user is told: what could not be done, and why. @param {object} command @param {string} what */
  async ask(command, what) {
    const error = await this.send(command);
    if (error) this.say(`${what}: ${error}`, "error");
    return error;
  }

  /** @param {object} message a message without a reply */
  tell(message) {
    this.connection.tell(message);
  }

  /** @param {Iterable<number>} ids */
  select(ids) {
    this.store.select(ids);
  }

  /** @param {string} name */
  useTool(name) {
    this.tool = name;
    this.store.emit("tool", name);
  }

  /** A line for the user, such as why a command was refused. @param {string} text @param {"info" | "error"} [level]
   * @param {string} [about] */
  say(text, level = "info", about = "") {
    if (this.unsaid) this.unsaid.push({ text, level, about });
    else this.store.emit("say", { text, level, about });
  }

  /** The panels have come. */
  sayAll() {
    const early = this.unsaid ?? [];
    this.unsaid = null;
    for (const { text, level, about } of early) this.say(text, level, about);
  }

  #looksAt() {
    const many = (this.store.team?.robots.length ?? 0) > MANY_ROBOTS;
    return {
      viewport: this.camera.viewport().map((v) => Math.round(100 * v) / 100),
      layers: [...this.layers.wire(), ...(this.tool === "goal" ? ["costs"] : [])],
      beams: many ? BEAMS_OF_MANY : BEAMS,
      selected: chosenRobots(this),
      follow: this.camera.follow,
    };
  }
}
