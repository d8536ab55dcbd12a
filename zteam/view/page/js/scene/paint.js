/** Drawing on the 2-D canvas above the map: a pen that knows the camera. */

/** @typedef {import("../app.js").App} App */
/**
 * @typedef {{ctx: CanvasRenderingContext2D, app: App, theme: import("./colors.js").Theme, ratio: number,
 *   radius: (id: number) => number, reach: (id: number) => number, names: import("./names.js").Name[], taken: Box[]}} Pen
 * ratio: device pixels a CSS pixel; radius: of a robot in metres; reach: pixels to a robot's edge; names: of robots;
 * taken: places that have a label already
 */
/** @typedef {[number, number, number, number]} Box left, top, right, bottom in pixels */

/** Of text, in CSS pixels as most browsers begin. */
const TEXT = 12,
  HEIGHT = 18;
const MARGIN = 60;

/** From now on, one unit is a CSS pixel. @param {Pen} pen */
export function inPixels({ ctx, ratio }) {
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
}

/**
 * From now on, one unit is a metre, in the frame of a pose in map.
 * @param {Pen} pen
 * @param {number} x
 * @param {number} y
 * @param {number} yaw
 */
export function inMetres({ ctx, app, ratio }, x, y, yaw) {
  const { camera } = app,
    [px, py] = camera.toScreen(x, y);
  const angle = camera.angle + yaw,
    k = camera.scale * ratio;
  ctx.setTransform(
    k * Math.cos(angle),
    -k * Math.sin(angle),
    -k * Math.sin(angle),
    -k * Math.cos(angle),
    px * ratio,
    py * ratio,
  );
}

/** @param {App} app @param {number} px @param {number} py */
export function isOnScreen({ camera }, px, py) {
  return px > -MARGIN && py > -MARGIN && px < camera.width + MARGIN && py < camera.height + MARGIN;
}

/**
 * An arrow on the screen, with a tip of 9 pixels.
 * @param {CanvasRenderingContext2D} ctx
 * @param {number} x
 * @param {number} y
 * @param {number} toX
 * @param {number} toY pixels
 */
export function arrow(ctx, x, y, toX, toY) {
  const angle = Math.atan2(toY - y, toX - x),
    tip = Math.min(9, Math.hypot(toX - x, toY - y));
  ctx.beginPath();
  ctx.moveTo(x, y);
  ctx.lineTo(toX - 0.7 * tip * Math.cos(angle), toY - 0.7 * tip * Math.sin(angle));
  ctx.stroke();
  ctx.beginPath();
  ctx.moveTo(toX, toY);
  for (const side of [-0.45, 0.45]) ctx.lineTo(toX - tip * Math.cos(angle + side), toY - tip * Math.sin(angle + side));
  ctx.closePath();
  ctx.fill();
}

/**
 * Where a pose points on the screen.
 * @param {App} app
 * @param {number} px
 * @param {number} py
 * @param {number} yaw
 * @param {number} length pixels
 * @returns {[number, number]}
 */
export function ahead({ camera }, px, py, yaw, length) {
  return [px + length * Math.cos(yaw + camera.angle), py - length * Math.sin(yaw + camera.angle)];
}

/** @param {CanvasRenderingContext2D} ctx @param {[number, number][]} points @param {boolean} close */
export function trace(ctx, points, close) {
  ctx.beginPath();
  points.forEach(([x, y], i) => (i ? ctx.lineTo(x, y) : ctx.moveTo(x, y)));
  if (close) ctx.closePath();
}

/** Strokes the current path, with a halo. @param {Pen} pen @param {string} color @param {number} width pixels */
export function strokeWithHalo({ ctx, theme }, color, width) {
  for (const [style, line] of /** @type {[string, number][]} */ ([
    [theme.css.halo, width + 2.5],
    [color, width],
  ])) {
    ctx.strokeStyle = style;
    ctx.lineWidth = line;
    ctx.stroke();
  }
}

/** So many new pictures, then those that were not used meanwhile go. */
const MAX_SPRITES = 2000;
/** Those of one theme, size of text and density, by look, then by text: a key of both would be made anew for each label.
 * @type {{halo: string, textSize: number, ratio: number, count: number, byLook: Map<string, Map<string, Sprite>>, older: Map<string, Map<string, Sprite>>}} */
const sprites = { halo: "", textSize: 0, ratio: 0, count: 0, byLook: new Map(), older: new Map() };

/** @typedef {{color?: string, bold?: boolean, align?: "center" | "left"}} Look */
/** @typedef {{canvas: HTMLCanvasElement, width: number, height: number}} Sprite a picture of text, size in CSS pixels */

/**
 * Text with a halo.
 * @param {Pen} pen
 * @param {string} text
 * @param {number} px
 * @param {number} py middle of the text
 * @param {Look} [look]
 */
export function label(pen, text, px, py, look = {}) {
  const sprite = spriteOf(pen, text, look);
  drawSprite(pen, sprite, look.align === "left" ? px + sprite.width / 2 : px, py);
}

/**
 * @param {Pen} pen
 * @param {Sprite} sprite
 * @param {number} px
 * @param {number} py its middle
 */
export function drawSprite({ ctx, ratio }, { canvas, width, height }, px, py) {
  const left = Math.round((px - width / 2) * ratio) / ratio,
    top = Math.round((py - height / 2) * ratio) / ratio;
  ctx.drawImage(canvas, left, top, width, height);
}

/** Text at the first of some places that no label has yet; nowhere if all are taken. @param {Pen} pen @param {string} text
 * @param {[number, number][]} places of its middle in pixels @param {Look} [look] @returns {boolean} whether it is shown */
export function labelWhereFree(pen, text, places, look = {}) {
  const sprite = spriteOf(pen, text, look),
    [half, tall] = [sprite.width / 2 - 2, sprite.height / 2 - 2];
  for (const [px, py] of places) {
    /** @type {Box} */
    const box = [px - half, py - tall, px + half, py + tall];
    if (!isFree(pen, box)) continue;
    pen.taken.push(box);
    drawSprite(pen, sprite, px, py);
    return true;
  }
  return false;
}

/** Whether a place is free for a label. @param {Pen} pen @param {Box} box */
export function isFree({ taken }, box) {
  for (let i = 0; i < taken.length; i++) {
    const other = taken[i];
    if (box[0] < other[2] && other[0] < box[2] && box[1] < other[3] && other[1] < box[3]) return false;
  }
  return true;
}

/** Text as a picture: drawing a picture takes a tenth of the time of drawing text.
 * @param {Pen} pen @param {string} text @param {Look} look */
export function spriteOf(pen, text, { color = pen.theme.css.text, bold = false } = {}) {
  const { css, textSize } = pen.theme,
    { halo } = css;
  if (sprites.halo !== halo || sprites.textSize !== textSize || sprites.ratio !== pen.ratio) {
    Object.assign(sprites, { halo, textSize, ratio: pen.ratio, count: 0, byLook: new Map(), older: new Map() });
  } else if (sprites.count >= MAX_SPRITES) Object.assign(sprites, { count: 0, byLook: new Map(), older: sprites.byLook });
  const look = bold ? `bold ${color}` : color;
  let byText = sprites.byLook.get(look);
  if (!byText) sprites.byLook.set(look, (byText = new Map()));
  let sprite = byText.get(text);
  if (!sprite) {
    byText.set(text, (sprite = sprites.older.get(look)?.get(text) ?? makeSprite(pen, text, color, bold)));
    sprites.count++;
  }
  return sprite;
}

/** @param {Pen} pen @param {string} text @param {string} color @param {boolean} bold */
function makeSprite(pen, text, color, bold) {
  const canvas = document.createElement("canvas"),
    { textSize } = pen.theme,
    font = `${bold ? "600 " : ""}${TEXT * textSize}px system-ui, sans-serif`,
    height = Math.ceil(HEIGHT * textSize);
  const ctx = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  ctx.font = font;
  const width = Math.ceil(ctx.measureText(text).width) + 6;
  canvas.width = Math.ceil(width * pen.ratio);
  canvas.height = Math.ceil(height * pen.ratio);
  ctx.scale(pen.ratio, pen.ratio);
  ctx.font = font;
  ctx.textBaseline = "middle";
  ctx.lineJoin = "round";
  ctx.lineWidth = 3;
  ctx.strokeStyle = pen.theme.css.halo;
  ctx.strokeText(text, 3, height / 2);
  ctx.fillStyle = color;
  ctx.fillText(text, 3, height / 2);
  return { canvas, width, height };
}
