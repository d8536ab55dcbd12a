/** Which layers are shown, how opaque, and of which robots. */

/** In groups; of a group with `perRobot` single robots can be left out. */
export const GROUPS = [
  { name: "world", title: "World", perRobot: false },
  { name: "robots", title: "Robots", perRobot: false },
  { name: "sensors", title: "Sensors", perRobot: true },
  { name: "navigation", title: "Navigation", perRobot: true },
];

/**
 * @typedef {{name: string, title: string, group: string, shown: boolean, wire?: string, always?: boolean, opacity?: number}} Layer
 * shown: at first; wire: the server is asked for it by this name, always: also while the map does not show it;
 * opacity: in percent at first, where it can be set
 */

/** @type {Layer[]} */
export const LAYERS = [
  { name: "map", title: "Map", group: "world", shown: true, opacity: 100 },
  { name: "grid", title: "Grid", group: "world", shown: true },
  { name: "obstacles", title: "Movable objects", group: "world", shown: true, wire: "obstacles", opacity: 100 },
  { name: "markers", title: "Markers and polygons", group: "world", shown: true, wire: "markers", opacity: 100 },
  { name: "robots", title: "Robots", group: "robots", shown: true },
  { name: "labels", title: "Names", group: "robots", shown: true },
  { name: "follow", title: "Followers and leaders", group: "robots", shown: true, opacity: 100 },
  { name: "trails", title: "Trails", group: "robots", shown: true, wire: "trails", opacity: 100 },
  { name: "tf", title: "Frames (TF)", group: "robots", shown: false, wire: "tf" },
  { name: "scans", title: "Laser points", group: "sensors", shown: true, wire: "scans", opacity: 100 },
  { name: "beams", title: "Laser beams", group: "sensors", shown: false, wire: "scans", opacity: 15 },
  { name: "sonars", title: "Sonars", group: "sensors", shown: false, wire: "sonars" },
  { name: "fiducials", title: "Fiducials", group: "sensors", shown: false, wire: "fiducials" },
  { name: "goals", title: "Goals", group: "navigation", shown: true, wire: "goals", always: true },
  { name: "plans", title: "Plans", group: "navigation", shown: true, wire: "plans", opacity: 100 },
  { name: "costmaps", title: "Costmaps", group: "navigation", shown: false, wire: "costmaps", opacity: 40 },
  { name: "particles", title: "Particles", group: "navigation", shown: false, wire: "particles", opacity: 50 },
];

const BY_NAME = new Map(LAYERS.map((layer) => [layer.name, layer]));
/** Less could not be told from a layer that is not shown. */
export const LEAST_OPACITY = 5;

/** The robot whose key it is; -1: of none. @param {string} key */
export function ownerOf(key) {
  return Number(/^robot_(\d+)\//.exec(key)?.[1] ?? -1);
}

/** The layers that are shown; emits "layers". */
export class Layers {
  /** Percent, where it is another one than at first. @type {Map<string, number>} */
  #opacities = new Map();
  /** Robots that are left out, by group. @type {Map<string, Set<number>>} */
  #hidden = new Map();

  /** @param {import("./store.js").Store} store */
  constructor(store) {
    this.store = store;
    /** @type {Set<string>} */
    this.shown = new Set(LAYERS.filter((layer) => layer.shown).map((layer) => layer.name));
  }

  #changed() {
    this.store.emit("layers", this.shown);
  }

  /** @param {string} name */
  has(name) {
    return this.shown.has(name);
  }

  /** @param {string} name @param {boolean} on */
  set(name, on) {
    if (on === this.shown.has(name) || !BY_NAME.has(name)) return;
    if (on) this.shown.add(name);
    else this.shown.delete(name);
    this.#changed();
  }

  /** @param {string} name @returns {number} percent */
  opacity(name) {
    return this.#opacities.get(name) ?? BY_NAME.get(name)?.opacity ?? 100;
  }

  /** @param {string} name of a layer whose opacity can be set @param {number} percent */
  setOpacity(name, percent) {
    const first = BY_NAME.get(name)?.opacity;
    if (first === undefined || !Number.isFinite(percent)) return;
    const opacity = Math.min(100, Math.max(LEAST_OPACITY, Math.round(percent)));
    if (opacity === first) this.#opacities.delete(name);
    else this.#opacities.set(name, opacity);
    this.#changed();
  }

  /** Whether a group's layers show this robot, which -1 stands for none. @param {string} group @param {number} robot */
  showsRobot(group, robot) {
    return !this.#hidden.get(group)?.has(robot);
  }

  /** @param {string} group @param {Iterable<number>} robots those that are left out from now on */
  hideRobots(group, robots) {
    this.#hidden.set(group, new Set(robots));
    this.#changed();
  }

  /** The robots that a group leaves out. @param {string} group @returns {number[]} */
  hiddenRobots(group) {
    return [...(this.#hidden.get(group) ?? [])].sort((a, b) => a - b);
  }

  /** Opacities and robots as text: `costmaps:60,sensors-0-2` is 60 %, and no sensors of robots 0 and 2. */
  get styles() {
    const opacities = [...this.#opacities].map(([name, percent]) => `${name}:${percent}`);
    const robots = GROUPS.map(({ name }) => [name, ...this.hiddenRobots(name)].join("-")).filter((text) => text.includes("-"));
    return [...opacities, ...robots].join(",");
  }

  /** What the text does not name is as at first. */
  set styles(text) {
    this.#opacities.clear();
    this.#hidden.clear();
    for (const part of text.split(",")) {
      const [, name, percent, robots] = /^([a-z]+)(?::(\d+)|((?:-\d+)+))$/.exec(part) ?? [];
      if (percent) this.setOpacity(name, Number(percent));
      else if (GROUPS.some((group) => group.perRobot && group.name === name)) this.#hidden.set(name, new Set(robots.slice(1).split("-").map(Number)));
    }
    this.#changed();
  }

  /** @returns {string[]} the names that the server knows */
  wire() {
    const names = LAYERS.filter((layer) => layer.wire && (layer.always || this.shown.has(layer.name))).map((layer) => String(layer.wire));
    return [...new Set(names)].sort();
  }
}
