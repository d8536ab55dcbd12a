/** All that the page knows of the team. Plain data; `on(name, fn)` tells what has changed. */

import { Emitter } from "./emitter.js";
import { ownerOf } from "./layers.js";
import { PoseTable } from "./poses.js";
import { isMap } from "./scene/grids.js";

const LOG_LINES = 2000;
/** Seconds of the host after which a line of a log is no longer one of now. */
const FRESH = 2;
/** @type {[number, number][][]} */
const NO_OUTLINE = [];
/** More than a robot has lasers. */
const SENSORS = 65536;

/** @typedef {"connecting" | "open" | "lost" | "refused"} ConnectionState */
/** @typedef {{id: number, name: string, model: string, outline: [number, number][][], state: string, behavior: string, driver: string, reason: string, leader: number, speed: number,
 *  age: number | null, lease: number | null, localised: boolean, truth: [number, number, number] | null, present: boolean, stopped: boolean, unheld: boolean, takes_goals: boolean}} Robot */
/** @typedef {{robots: Robot[], gate: any, sim: any, router: boolean, viewers: number, namespace: string,
 *  behaviors: string[], launcher: boolean, options: string, loading: boolean, lists: Record<string, boolean>,
 *  refused: string[] | null}} Team */

/**
 * Events: connection, frame (after each frame, with it), robots (poses), team, tf, topics, log (new lines), goals,
 * markers, obstacles, sonars, fiducials, echo ({topic, stamp, json}), samples (a block), scans, grids (key), paths (key),
 * posearrays (key), replay, selection, layers, camera, tool, theme, drive.
 */
export class Store extends Emitter {
  /** token: the server looks at one, or has refused it.
   * @type {{state: ConnectionState, reason: string, viewer: number, mayCommand: boolean, token: "" | "asked" | "wrong"}} */
  connection = { state: "connecting", reason: "", viewer: -1, mayCommand: false, token: "" };
  /** Of the newest frame; stamp and age in seconds (age < 0: no new poses), received in ms of performance.now(). */
  frame = { number: -1, tick: 0, stamp: 0, age: 0, received: 0 };
  /** The newest frame that brought poses. */
  posed = this.frame;
  /** Poses in map, one entry a robot. */
  poses = new PoseTable();
  /** @type {Team | null} */
  team = null;
  /** @type {Map<number, Robot>} robots of the team doc by id */
  robots = new Map();
  /** @type {Map<number, import("./wire.js").Scan>} by SENSORS * robot + sensor */
  scans = new Map();
  /** @type {Map<string, Map<string, GridTile>>} tiles by key and place */
  grids = new Map();
  /** @type {Map<string, Float32Array>} x, y pairs in map by key */
  paths = new Map();
  /** @type {Map<string, Float32Array>} x, y, yaw triples in map by key */
  posearrays = new Map();
  /** @type {Record<string, any>} the newest of each doc by name */
  docs = {};
  /** @type {import("./panels/log.js").Line[]} the newest lines, oldest first */
  log = [];
  /** @type {Set<number>} */
  selection = new Set();
  /** Robots that were removed: what is under way of them is dropped when it has come. @type {Set<number>} */
  #gone = new Set();

  /**
   * Everything of a frame, then one event for each kind that came.
   * @param {import("./wire.js").Frame} frame @param {number} received ms
   */
  takeFrame(frame, received) {
    // Time was set back: what was drawn is of a later time.
    if (frame.stamp < this.frame.stamp) this.clearTeam();
    this.frame = { number: frame.number, tick: frame.tick, stamp: frame.stamp, age: frame.age, received };
    /** @type {Map<string, any[]>} */
    const events = new Map();
    let scans = false;
    for (const block of frame.blocks) {
      if (block.type === "poses") {
        this.poses.take(block, frame.stamp, received);
        this.posed = this.frame;
        events.set("robots", [undefined]);
      } else if (block.type === "scan") {
        this.scans.set(SENSORS * block.robot + block.sensor, block);
        if (!scans) events.set("scans", [undefined]);
        scans = true;
      } else if (block.type === "grid") {
        events.set("grid", [...(events.get("grid") ?? []), block]);
      } else {
        const [name, detail] = this.#takeBlock(block);
        const many = name === "samples" || name === "echo";
        events.set(name, many ? [...(events.get(name) ?? []), detail] : [detail]);
      }
    }
    for (const [name, details] of events) for (const detail of details) this.emit(name, detail);
    this.emit("frame", this.frame);
  }

  /**
   * @param {Exclude<import("./wire.js").Block, {type: "poses"} | {type: "grid"} | {type: "scan"}>} block
   * @returns {[string, any]} the event
   */
  #takeBlock(block) {
    switch (block.type) {
      case "path":
        this.paths.set(block.key, block.points);
        return ["paths", block.key];
      case "posearray":
        this.posearrays.set(block.key, block.poses);
        return ["posearrays", block.key];
      case "samples":
        return ["samples", block];
      case "doc":
        return [block.name, this.#takeDoc(block.name, block.value)];
    }
  }

  /** Whether a recording is shown instead of a team: it takes no commands. */
  get isRecorded() {
    return Boolean(this.docs.replay);
  }

  /** @param {string} name @param {any} value */
  #takeDoc(name, value) {
    const isSwitch = name === "replay" && this.isRecorded !== Boolean(value);
    this.docs[name] = value;
    if (isSwitch) this.emit("connection", this.connection);
    if (name === "team") {
      this.team = value;
      const before = this.robots;
      for (const robot of value.robots) robot.outline = value.outlines[robot.outline] ?? NO_OUTLINE;
      this.robots = new Map(value.robots.map((/** @type {Robot} */ robot) => [robot.id, robot]));
      this.#forgetGone(before);
    } else if (name === "log") {
      const now = Date.now() / 1000, { sim } = this.team ?? {};
      // One that came just now was logged at about the frame's time; of older ones nothing is known.
      for (const line of sim?.present ? value : []) {
        const ago = now - line.time;
        if (Math.abs(ago) < FRESH) line.stamp = this.frame.stamp - Math.max(0, ago) * (sim.state === "running" ? sim.rtf : 0);
      }
      this.log.push(...value);
      if (this.log.length > LOG_LINES) this.log.splice(0, this.log.length - LOG_LINES);
    }
    return value;
  }

  /**
   * What robots that are gone have left goes too. A layout may have selected a robot that has not come yet.
   * @param {Map<number, Robot>} before
   */
  #forgetGone(before) {
    for (const [key, scan] of this.scans) if (!this.robots.has(scan.robot)) this.scans.delete(key);
    for (const id of before.keys()) if (!this.robots.has(id)) this.#gone.add(id);
    for (const id of this.robots.keys()) this.#gone.delete(id);
    for (const name of this.#gone.size ? /** @type {const} */ (["paths", "posearrays", "grids"]) : []) {
      for (const key of this[name].keys()) if (this.#gone.has(ownerOf(key)) && this[name].delete(key)) this.emit(name, key);
    }
    const left = [...this.selection].filter((id) => this.robots.has(id) || !before.has(id));
    if (left.length < this.selection.size) this.select(left);
  }

  /** The team is gone, the connection, or its time was set back: what was drawn is no longer true. The map and the log stay. */
  clearTeam() {
    for (const key of this.grids.keys()) if (!isMap(key) && this.grids.delete(key)) this.emit("grids", key);
    this.poses.clear();
    this.scans.clear();
    this.paths.clear();
    this.posearrays.clear();
    for (const name of ["goals", "markers", "obstacles", "sonars", "fiducials", "tf"]) delete this.docs[name];
    this.emit("robots");
  }

  /** @param {Iterable<number>} ids */
  select(ids) {
    this.selection = new Set(ids);
    this.emit("selection", this.selection);
  }

  /** @param {Partial<Store["connection"]>} change */
  setConnection(change) {
    this.connection = { ...this.connection, ...change };
    this.emit("connection", this.connection);
  }
}

/** @typedef {{meta: import("./wire.js").GridMeta, cells: Int8Array}} GridTile */
