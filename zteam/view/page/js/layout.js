/**
 * What the view shows, as text: in the page's address, and in a file that `zteam view --layout FILE` gives to the page.
 * Each part of the page has a name and one line of text, the same in both.
 */

export const FORMAT = 1;
const FILE = "/layout.json";
const WRITE_AFTER = 400; // ms: browsers refuse more than about three changes of an address a second

/** @typedef {{get: () => string, set: (text: string) => void}} Part set ignores what it cannot read */

export class Layout {
  /** @type {Map<string, Part>} */
  #parts = new Map();
  /** @type {Map<string, string>} what the parts say without a layout: the address leaves it out */
  #defaults = new Map();
  #timer = 0;
  #written = "";

  /** @param {string} name @param {Part} part @param {string} [initial] what it says on a new page */
  register(name, part, initial = part.get()) {
    this.#parts.set(name, part);
    this.#defaults.set(name, initial);
  }

  /** @returns {{version: number, [part: string]: string | number}} */
  collect() {
    const parts = [...this.#parts].map(([name, part]) => [name, part.get()]);
    return { version: FORMAT, ...Object.fromEntries(parts) };
  }

  /**
   * @param {any} layout as `collect` gives it; parts that are missing stay as they are
   * @returns {string} what is wrong with it; "" if all of it was taken
   */
  apply(layout) {
    if (typeof layout !== "object" || layout === null || layout.version !== FORMAT) {
      return `this is no layout of version ${FORMAT}`;
    }
    const unknown = [];
    for (const [name, text] of Object.entries(layout)) {
      const part = this.#parts.get(name);
      if (part && typeof text === "string") part.set(text);
      else if (name !== "version") unknown.push(name);
    }
    return unknown.length ? `the layout has parts that this page does not know: ${unknown.join(", ")}` : "";
  }

  /** Something that a part says has changed. */
  changed() {
    if (!this.#timer) this.#timer = setTimeout(() => this.#write(), WRITE_AFTER);
  }

  #write() {
    this.#timer = 0;
    const fragment = new URLSearchParams();
    for (const [name, part] of this.#parts) {
      const text = part.get();
      if (text !== this.#defaults.get(name)) fragment.set(name, text);
    }
    // A query's quoting would make slashes and commas unreadable, which a fragment may hold.
    const text = fragment.toString().replaceAll("%2F", "/").replaceAll("%2C", ",").replaceAll("%3A", ":");
    const address = `${location.pathname}${location.search}${text ? `#${text}` : ""}`;
    if (address !== this.#written) history.replaceState(null, "", address);
    this.#written = address;
  }

  /** The server's file first, then the address, which is newer. @returns {Promise<string>} what is wrong, or "" */
  async open() {
    const address = Object.fromEntries(new URLSearchParams(location.hash.slice(1)));
    let problem = "";
    try {
      const reply = await fetch(FILE);
      // 204: the view was started without a file.
      if (reply.status === 200) problem = this.apply(await reply.json());
    } catch (error) {
      problem = `the layout file: ${error}`;
    }
    this.apply({ ...address, version: FORMAT });
    return problem;
  }

  /** Downloads the layout as a file. */
  save() {
    download(new Blob([`${JSON.stringify(this.collect(), null, 2)}\n`], { type: "application/json" }), "layout.json");
  }
}

/** @param {Blob} blob @param {string} name */
export function download(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  // The browser reads the blob after the click.
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
