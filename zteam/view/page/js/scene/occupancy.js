/** Which places of the screen are taken, in cells of a few pixels: asking does not take longer the more there is. */

const CELL = 4;

/** @typedef {import("./paint.js").Box} Box */

export class Occupancy {
  #columns = 0;
  #rows = 0;
  #cells = new Uint8Array(0);

  /** Nothing is taken. @param {number} width @param {number} height of the screen in pixels */
  begin(width, height) {
    this.#columns = Math.ceil(width / CELL);
    this.#rows = Math.ceil(height / CELL);
    const size = this.#columns * this.#rows;
    if (size > this.#cells.length) this.#cells = new Uint8Array(size);
    else this.#cells.fill(0);
  }

  /** @param {Box} box @returns {Box} first column and row, and those after the last */
  #range([left, top, right, bottom]) {
    return [
      Math.max(0, Math.round(left / CELL)),
      Math.max(0, Math.round(top / CELL)),
      Math.min(this.#columns, Math.round(right / CELL)),
      Math.min(this.#rows, Math.round(bottom / CELL)),
    ];
  }

  /** @param {Box} box */
  take(box) {
    const [left, top, right, bottom] = this.#range(box);
    if (left >= right) return;
    for (let row = top; row < bottom; row++) {
      this.#cells.fill(1, row * this.#columns + left, row * this.#columns + right);
    }
  }

  /** Whether all of it is on the screen. @param {Box} box */
  holds([left, top, right, bottom]) {
    return left >= 0 && top >= 0 && right <= CELL * this.#columns && bottom <= CELL * this.#rows;
  }

  /** Whether nothing is there; what is not on the screen is free. @param {Box} box */
  isFree(box) {
    const [left, top, right, bottom] = this.#range(box);
    for (let row = top; row < bottom; row++) {
      for (let i = row * this.#columns + left; i < row * this.#columns + right; i++) if (this.#cells[i]) return false;
    }
    return true;
  }
}
