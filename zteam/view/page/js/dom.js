// Elements without a framework: text always goes in as text, never as markup.

/**
 * An element with attributes, listeners (functions under `onclick` and so on) and children.
 *
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Record<string, string | number | boolean | null | ((event: any) => void)>} [attributes] `false` and `null` leave one out
 * @param {...(Node | string)} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function el(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") node.addEventListener(name.slice(2), value);
    else if (value !== false && value !== null) node.setAttribute(name, value === true ? "" : String(value));
  }
  node.append(...children);
  return node;
}

const TEXT = Symbol("text");

/**
 * Sets an element's text if it is another one: an unchanged text costs no layout. What else sets it must use this too:
 * the element's own text is not read, which would take longer than all else in a table of a hundred robots.
 *
 * @param {Element} node
 * @param {string} text
 */
export function setText(node, text) {
  const known = /** @type {any} */ (node);
  if (known[TEXT] === text) return;
  known[TEXT] = node.textContent = text;
}

/**
 * A name of a topic or frame, which a narrow column may break behind its parts.
 *
 * @param {string} name
 * @returns {(Node | string)[]}
 */
export function breakable(name) {
  return name.split(/(?<=[/_])/).flatMap((part) => [part, document.createElement("wbr")]);
}

/**
 * Sets or removes an attribute.
 *
 * @param {Element} node
 * @param {string} name
 * @param {string | boolean | null} value
 */
export function setAttribute(node, name, value) {
  if (value === false || value === null) node.removeAttribute(name);
  else if (node.getAttribute(name) !== String(value)) node.setAttribute(name, value === true ? "" : value);
}

/**
 * Makes the children of `container` match `items`, in order; an item keeps its element by its key.
 *
 * @template T
 * @template {Element} E
 * @param {HTMLElement} container has no other children but the head of a table
 * @param {readonly T[]} items
 * @param {(item: T) => string} keyOf
 * @param {(item: T) => E} create
 * @param {(node: E, item: T) => void} update
 */
export function reconcile(container, items, keyOf, create, update) {
  /** @type {Map<string, E>} */
  const known = /** @type {any} */ (container)[CHILDREN] ?? new Map();
  /** @type {Map<string, E>} */
  const kept = new Map();
  let next = container instanceof HTMLTableElement && container.tHead ? container.tHead.nextElementSibling : container.firstElementChild;
  for (const item of items) {
    const key = keyOf(item);
    const node = known.get(key) ?? create(item);
    update(node, item);
    kept.set(key, node);
    if (node === next) next = next.nextElementSibling;
    else container.insertBefore(node, next);
  }
  for (const [key, node] of known) if (!kept.has(key)) node.remove();
  /** @type {any} */ (container)[CHILDREN] = kept;
}

const CHILDREN = Symbol("children by key");

/**
 * A button with an icon, and its label for screen readers and as a tooltip.
 *
 * @param {keyof typeof ICONS} icon
 * @param {string} label
 * @param {(event: MouseEvent) => void} onclick
 * @returns {HTMLButtonElement}
 */
export function iconButton(icon, label, onclick) {
  return el("button", { type: "button", class: "icon", title: label, "aria-label": label, onclick }, drawIcon(icon));
}

/**
 * @param {keyof typeof ICONS} name
 * @returns {SVGElement}
 */
export function drawIcon(name) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 16 16");
  svg.setAttribute("aria-hidden", "true");
  const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  path.setAttribute("d", ICONS[name]);
  svg.append(path);
  return svg;
}

// Strokes in a square of 16 units, drawn with the text's colour.
const ICONS = {
  pause: "M5.5 3v10M10.5 3v10",
  play: "M4.5 2.8v10.4L13 8z",
  step: "M3.5 3v10L9.5 8zM12.5 3v10",
  back: "M12.5 3v10L6.5 8zM3.5 3v10",
  reset: "M3 8a5 5 0 1 0 1.6-3.7M3 2.5V5.5H6",
  picture: "M2 4.5h3l1-1.5h4l1 1.5h3v8H2zM8 6.2a2.3 2.3 0 1 0 .01 0",
  theme: "M8 2.5a5.5 5.5 0 1 0 0 11zM8 2.5a5.5 5.5 0 0 1 0 11",
  menu: "M2.5 4.5h11M2.5 8h11M2.5 11.5h11",
  help: "M5.6 6a2.4 2.4 0 1 1 3.6 2.1c-.8.5-1.2.9-1.2 1.9M8 12.4v.6",
  side: "M2 3h12v10H2zM10 3v10",
  dock: "M2 3h12v10H2zM2 9.5h12",
  close: "M4 4l8 8M12 4l-8 8",
  plot: "M2 2.5v11h12M4 10l3-4 2.5 2L13 4",
  pin: "M8 14s4.5-4.3 4.5-7.5a4.5 4.5 0 0 0-9 0C3.5 9.7 8 14 8 14zM8 5v3",
};

const CONFIRM_WITHIN = 4000; // ms

/**
 * A button that acts at its second click.
 *
 * @param {string} label
 * @param {string} question shown after the first click
 * @param {() => void} act
 * @returns {HTMLButtonElement}
 */
export function confirmButton(label, question, act) {
  let timer = 0;
  const back = () => {
    clearTimeout(timer);
    timer = 0;
    button.textContent = label;
    button.removeAttribute("aria-pressed");
  };
  const button = el("button", { type: "button" }, label);
  // What stands beside it must not move under the pointer.
  button.style.minWidth = `calc(${Math.max(label.length, question.length)} * .75ch + 1.125rem)`;
  button.addEventListener("click", () => {
    if (timer) {
      back();
      act();
      return;
    }
    button.textContent = question;
    button.setAttribute("aria-pressed", "true");
    timer = setTimeout(back, CONFIRM_WITHIN);
  });
  return button;
}
