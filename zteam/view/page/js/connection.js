/** The WebSocket to the server: hello, frames and their acknowledgement, commands and their replies, coming back. */

import { keep, recall } from "./kept.js";
import { decodeFrame, unpack, VERSION } from "./wire.js";

const RETRY = [0.25, 0.5, 1, 2];
const LOOK_PERIOD = 100;
const HIDDEN_PERIOD = 1000;
const REPLY_LIMIT = 10000;
const NOT_CONNECTED = "not connected to the server";
export const WATCHING = "watching only: enter the token of the address that zteam printed";
const TOKEN = "zteam-token";

/** The token of the URL's fragment, taken out of the address that a user might copy. */
export function takeToken() {
  const fragment = new URLSearchParams(location.hash.slice(1));
  const token = fragment.get("token");
  if (token) {
    fragment.delete("token");
    history.replaceState(null, "", `${location.pathname}${location.search}${fragment.size ? `#${fragment}` : ""}`);
  }
  return token ?? "";
}

/** Under what the browser keeps the token of a team, for this origin. @param {string} team its namespace */
const keyOf = (team) => `${TOKEN}:${team}`;

/** One server; connects again when it comes back. */
export class Connection {
  /** Bytes of all frames so far. */
  bytes = 0;
  /** Milliseconds of JavaScript for frames since the last drawing. */
  decodingMs = 0;
  /** @type {WebSocket | null} */
  #socket = null;
  #attempt = 0;
  #seq = 0;
  /** @type {Map<number, (error: string) => void>} */
  #replies = new Map();
  /** @type {Map<string, {topic: string, field: string, count: number}>} */
  #watches = new Map();
  /** @type {Set<string>} docs that panels show */
  #docs = new Set();
  /** The namespace of the team: a browser may know several. */
  #team = "";
  #lookTimer = 0;
  #lastLook = "";
  /** @type {Promise<void>} tiles are unpacked in their order */
  #unpacking = Promise.resolve();

  /**
   * @param {import("./store.js").Store} store
   * @param {() => object} looksAt the fields of `look` that the scene knows
   * @param {string} token
   */
  constructor(store, looksAt, token) {
    this.store = store;
    this.looksAt = looksAt;
    this.token = token;
    store.on("grid", (block) => this.#takeGrid(block));
    for (const name of ["camera", "layers", "selection", "tool"]) store.on(name, () => this.look());
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/ws`);
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    socket.onopen = () => {
      this.#raw({ op: "hello", version: VERSION, token: this.token });
      // Without waiting for the welcome: over a slow link that takes long.
      this.#look(true);
    };
    socket.onmessage = (event) => {
      if (typeof event.data === "string") this.#takeText(JSON.parse(event.data));
      else this.#takeBinary(event.data);
    };
    socket.onclose = (event) => this.#closed(event);
  }

  /** @param {CloseEvent} event */
  #closed(event) {
    const reason = this.store.connection.state === "refused" ? this.store.connection.reason : event.reason;
    for (const reply of this.#replies.values()) reply(NOT_CONNECTED);
    this.#replies.clear();
    this.#lastLook = "";
    this.store.clearTeam();
    this.store.setConnection({ state: "lost", reason: reason || "the server is gone", mayCommand: false, viewer: -1 });
    const delay = RETRY[Math.min(this.#attempt++, RETRY.length - 1)];
    setTimeout(() => this.open(), 1000 * delay);
  }

  /** Asks for the right to command with a token that the user gives. @param {string} token */
  useToken(token) {
    this.token = token;
    this.store.setConnection({ token: "asked" });
    this.tell({ op: "token", token });
  }

  /** What the server says of the token that it was sent. A right one is kept, a wrong one forgotten.
   * @param {boolean} mayCommand */
  #takeRights(mayCommand) {
    const wrong = !mayCommand && this.token !== "",
      kept = recall(keyOf(this.#team));
    if (mayCommand) keep(keyOf(this.#team), this.token);
    else if (wrong && kept === this.token) keep(keyOf(this.#team), "");
    // The address had none, or an old one: the newest that was right here may still be.
    else if (kept) return this.useToken(kept);
    if (wrong) this.token = "";
    this.store.setConnection({ mayCommand, token: wrong ? "wrong" : "" });
  }

  /** @param {any} message */
  #takeText(message) {
    if (message.op === "welcome") {
      this.#attempt = 0;
      this.#team = message.namespace;
      this.store.setConnection({ state: "open", reason: "", viewer: message.viewer, token: "asked" });
      this.#takeRights(message.may_command);
      this.#look();
      for (const { topic, field } of this.#watches.values()) this.#raw({ op: "watch", topic, field });
    } else if (message.op === "rights") {
      this.#takeRights(message.may_command);
    } else if (message.op === "reply") {
      this.#replies.get(message.seq)?.(message.error);
      this.#replies.delete(message.seq);
    } else if (message.op === "lost") {
      this.store.emit("lost", message.robot);
    } else if (message.op === "refused") {
      this.store.setConnection({ state: "refused", reason: message.reason });
    }
  }

  /** @param {ArrayBuffer} data */
  #takeBinary(data) {
    const received = performance.now();
    this.bytes += data.byteLength;
    let frame;
    try {
      frame = decodeFrame(data);
    } catch (error) {
      this.store.setConnection({ state: "refused", reason: String(error) });
      return this.#socket?.close();
    }
    this.store.takeFrame(frame, received);
    this.#acknowledge(frame.number);
    this.decodingMs += performance.now() - received;
  }

  /**
   * Asks for the next frame: at once, or as long as the page is not seen, once a second.
   * @param {number} frame
   */
  #acknowledge(frame) {
    const socket = this.#socket;
    const send = () => {
      if (socket === this.#socket) this.#raw({ op: "ack", frame });
    };
    if (document.hidden) setTimeout(send, HIDDEN_PERIOD);
    else send();
  }

  /** @param {import("./wire.js").Grid} block */
  #takeGrid(block) {
    const { meta } = block;
    this.#unpacking = this.#unpacking
      .then(async () => {
        const cells = await unpack(block.packed);
        let tiles = this.store.grids.get(meta.key);
        const first = tiles?.values().next().value?.meta;
        if (!tiles || !first || !sameGrid(first, meta)) this.store.grids.set(meta.key, (tiles = new Map()));
        tiles.set(`${meta.tile[0]},${meta.tile[1]}`, { meta, cells });
        this.store.emit("grids", meta.key);
      })
      .catch((error) => console.error(`a tile of ${meta.key}:`, error));
  }

  /** @param {object} message */
  #raw(message) {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(message));
  }

  get #ready() {
    return this.store.connection.state === "open";
  }

  /** Sends what has no reply, such as `drive`. @param {object} message */
  tell(message) {
    if (this.#ready) this.#raw(message);
  }

  /** @param {Record<string, any>} command without `seq` @returns {Promise<string>} why it was refused; "" if it was carried out */
  send(command) {
    if (!this.#ready) return Promise.resolve(NOT_CONNECTED);
    if (!this.store.connection.mayCommand && command.op !== "stop_robots") {
      return Promise.resolve(WATCHING);
    }
    const seq = ++this.#seq;
    return new Promise((resolve) => {
      const timer = setTimeout(() => this.#replies.get(seq)?.("no reply from the server"), REPLY_LIMIT);
      this.#replies.set(seq, (error) => {
        clearTimeout(timer);
        resolve(error);
      });
      this.#raw({ ...command, seq });
    });
  }

  /** Messages (field "") or samples of a number of them come as events until as many calls of `unwatch`.
   * @param {string} topic @param {string} [field] */
  watch(topic, field = "") {
    const key = JSON.stringify([topic, field]),
      known = this.#watches.get(key);
    if (known) known.count++;
    else {
      this.#watches.set(key, { topic, field, count: 1 });
      this.tell({ op: "watch", topic, field });
    }
  }

  /** @param {string} topic @param {string} [field] */
  unwatch(topic, field = "") {
    const key = JSON.stringify([topic, field]),
      known = this.#watches.get(key);
    if (!known || --known.count > 0) return;
    this.#watches.delete(key);
    this.tell({ op: "unwatch", topic, field });
  }

  /** @param {string} name a doc, such as "tf", "topics", "log" @param {boolean} wanted */
  want(name, wanted) {
    if (wanted) this.#docs.add(name);
    else this.#docs.delete(name);
    this.look();
  }

  /** Says what the page shows now, at most ten times a second. */
  look() {
    if (!this.#lookTimer) this.#lookTimer = setTimeout(() => this.#look(), LOOK_PERIOD);
  }

  #look(greets = false) {
    clearTimeout(this.#lookTimer);
    this.#lookTimer = 0;
    const message = { op: "look", ...this.looksAt(), docs: [...this.#docs].sort() };
    const text = JSON.stringify(message);
    if (!(greets || this.#ready) || text === this.#lastLook) return;
    this.#lastLook = text;
    this.#raw(message);
  }
}

/** @param {import("./wire.js").GridMeta} a @param {import("./wire.js").GridMeta} b */
function sameGrid(a, b) {
  return ["width", "height", "resolution", "x", "y", "yaw"].every(
    (name) => /** @type {any} */ (a)[name] === /** @type {any} */ (b)[name],
  );
}
