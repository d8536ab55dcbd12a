/** Driving one robot: the lease, and commands ten times a second while it is held. */

import { whyNoTool } from "../rights.js";
import { commandOf, isZero, scaled } from "./law.js";

/** ms between commands: five of them fit into the dead man's 0.5 s. */
const PERIOD = 100;
/** As `zteam teleop` begins. */
const SPEED = 0.5;
const TURN = 1.0;

/** @typedef {import("./law.js").Shares} Shares */
/** @typedef {"none" | "asked" | "held"} Lease */

/** Emits "drive" when anything of it changes. */
export class Driver {
  /** Whether keys, stick and gamepad are for driving. */
  mode = false;
  /** The robot that they drive; -1: none. */
  robot = -1;
  /** @type {Lease} */
  lease = "none";
  limits = { speed: SPEED, turn: TURN };
  /** @type {Map<string, Shares>} what each device asks for, by its name */
  #wishes = new Map();
  #timer = 0;

  /** @param {import("../app.js").App} app */
  constructor(app) {
    this.app = app;
    app.store.on("selection", () => this.#follow());
    app.store.on("connection", ({ state }) => {
      if (state !== "open") this.#forget();
    });
    app.store.on("lost", (robot) => this.#lose(robot));
    window.addEventListener("blur", () => this.letGo());
    window.addEventListener("pagehide", () => this.letGo());
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.letGo();
    });
  }

  /** @param {boolean} on */
  set(on) {
    if (on === this.mode) return;
    const why = on ? whyNoTool(this.app, "drive") : "";
    if (why) return this.app.say(`Drive: ${why}`, "error");
    if (!on) this.letGo();
    this.mode = on;
    // Keys are for the robot now, not for what was clicked last.
    if (on && document.activeElement instanceof HTMLElement) document.activeElement.blur();
    this.#follow();
    if (on && this.robot < 0) this.app.say("Driving: select a robot", "info");
    this.#changed();
  }

  /** The robot to drive is the selected one, or the only one there is. */
  #follow() {
    const { selection, robots } = this.app.store;
    const robot =
      selection.size === 1 ? [...selection][0] : !selection.size && robots.size === 1 ? [...robots.keys()][0] : -1;
    if (robot === this.robot) return;
    this.letGo();
    this.robot = this.mode ? robot : -1;
    this.#changed();
  }

  /** Stop, let go, and select the next robot. */
  next() {
    const ids = [...this.app.store.robots.keys()].sort((a, b) => a - b);
    if (!ids.length) return;
    this.letGo();
    this.app.select([ids[(ids.indexOf(this.robot) + 1) % ids.length]]);
  }

  /**
   * What a device asks for now. The first wish that is not zero takes the lease.
   * @param {string} device @param {Shares} shares
   */
  wish(device, shares) {
    if (isZero(shares)) this.#wishes.delete(device);
    else this.#wishes.set(device, shares);
    if (!this.mode || this.robot < 0) return;
    if (this.lease === "held") this.#drive();
    else if (this.lease === "none" && !isZero(shares)) this.#take();
  }

  /** A key that changes the speeds. @param {string} key */
  scale(key) {
    this.limits = scaled(this.limits, key);
    this.#changed();
  }

  /** Zero velocity until the next wish; the lease stays. */
  stop() {
    this.#wishes.clear();
    if (this.lease === "held") this.#drive();
  }

  /** Stop the robot and give the lease back. */
  letGo() {
    this.#wishes.clear();
    if (this.lease === "none") return;
    const robot = this.robot;
    if (this.lease === "held") this.#drive();
    this.#forget();
    this.app.send({ op: "release", robot });
  }

  /** Without a word to the server. */
  #forget() {
    this.#wishes.clear();
    clearInterval(this.#timer);
    if (this.lease === "none") return;
    this.lease = "none";
    this.#changed();
  }

  async #take() {
    const robot = this.robot;
    this.lease = "asked";
    this.#changed();
    const error = await this.app.send({ op: "take", robot });
    if (this.lease !== "asked" || this.robot !== robot) return;
    if (error) {
      this.#forget();
      return this.app.say(`Robot ${robot} cannot be driven: ${error}`, "error");
    }
    this.lease = "held";
    this.#timer = setInterval(() => this.#drive(), PERIOD);
    this.#drive();
    this.#changed();
  }

  /** The server's answer to a command: the lease has ended, as when another teleop takes the robot. @param {number} robot */
  #lose(robot) {
    if (this.lease !== "held" || robot !== this.robot) return;
    this.#forget();
    this.app.say(`Robot ${robot} is no longer driven from this page`, "error");
  }

  #drive() {
    const { linear, left, angular } = commandOf(this.#total(), this.limits);
    const message = { op: "drive", robot: this.robot, linear, angular };
    this.app.tell(left ? { ...message, left } : message);
  }

  /** @returns {Shares} of the device that is farthest out in each direction */
  #total() {
    const total = { linear: 0, left: 0, angular: 0 };
    for (const shares of this.#wishes.values()) {
      for (const name of /** @type {const} */ (["linear", "left", "angular"])) {
        if (Math.abs(shares[name]) > Math.abs(total[name])) total[name] = shares[name];
      }
    }
    return total;
  }

  #changed() {
    this.app.store.emit("drive", this);
  }
}
