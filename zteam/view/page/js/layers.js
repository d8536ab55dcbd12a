/** Which layers are shown. */

/** Names, titles and whether a layer is shown at first; `wire`: the server is asked for it by this name. */
export const LAYERS = [
  { name: "map", title: "Map", shown: true },
  { name: "robots", title: "Robots", shown: true },
  { name: "labels", title: "Names", shown: true },
  { name: "scans", title: "Laser points", shown: true, wire: "scans" },
  { name: "beams", title: "Laser beams", shown: false, wire: "scans" },
  { name: "follow", title: "Followers and leaders", shown: true },
  { name: "trails", title: "Trails", shown: true, wire: "trails" },
  { name: "goals", title: "Goals", shown: true, wire: "goals" },
  { name: "plans", title: "Plans", shown: true, wire: "plans" },
  { name: "obstacles", title: "Things to push", shown: true, wire: "obstacles" },
  { name: "markers", title: "Markers and polygons", shown: true, wire: "markers" },
  { name: "costmaps", title: "Costmaps", shown: false, wire: "costmaps" },
  { name: "particles", title: "Particles", shown: false, wire: "particles" },
  { name: "sonars", title: "Sonars", shown: false, wire: "sonars" },
  { name: "fiducials", title: "Fiducials", shown: false, wire: "fiducials" },
  { name: "tf", title: "Frames (TF)", shown: false, wire: "tf" },
  { name: "grid", title: "Grid", shown: true },
];

/** The layers that are shown; emits "layers". */
export class Layers {
  /** @param {import("./store.js").Store} store */
  constructor(store) {
    this.store = store;
    /** @type {Set<string>} */
    this.shown = new Set(LAYERS.filter((layer) => layer.shown).map((layer) => layer.name));
  }

  /** @param {string} name */
  has(name) {
    return this.shown.has(name);
  }

  /** @param {string} name @param {boolean} on */
  set(name, on) {
    if (on === this.shown.has(name) || !LAYERS.some((layer) => layer.name === name)) return;
    if (on) this.shown.add(name);
    else this.shown.delete(name);
    this.store.emit("layers", this.shown);
  }

  /** @returns {string[]} the names that the server knows */
  wire() {
    const names = LAYERS.filter((layer) => layer.wire && this.shown.has(layer.name)).map((layer) => String(layer.wire));
    return [...new Set(names)].sort();
  }
}
