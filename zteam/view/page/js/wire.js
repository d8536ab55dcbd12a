/** The binary frames of the server, version 1. Pure: bytes in, plain objects out. Little endian throughout. */

export const VERSION = 1;
export const NO_RETURN = 0xffff;
export const INVALID = 0xfffe;

const HEADER = 32;
const POSES = 1,
  SCAN = 2,
  DOC = 3,
  GRID = 4,
  PATH = 5,
  POSE_ARRAY = 6,
  SAMPLES = 7;
const YAW_STEP = 1e-4;
const text = new TextDecoder();

/** @typedef {{number: number, tick: number, stamp: number, age: number, blocks: Block[]}} Frame seconds */
/** @typedef {{type: "poses", truth: boolean, ids: Uint16Array, x: Float32Array, y: Float32Array, yaw: Float32Array}}
 *   Poses
 *  in map, metres and radians; truth: from the simulator, for robots without transforms */
/** @typedef {{type: "scan", robot: number, sensor: number, x: number, y: number, yaw: number, angleMin: number,
 * angleIncrement: number, rangeMax: number, step: number, ranges: Uint16Array}} Scan the sensor's pose in map; ranges
 *   in steps */
/** @typedef {{type: "doc", name: string, value: any}} Doc */
/** @typedef {{key: string, width: number, height: number, resolution: number, x: number, y: number, yaw: number,
 *  tile: [number, number, number, number], version: number}} GridMeta tile: column, row, width, height in cells */
/** @typedef {{type: "grid", meta: GridMeta, packed: Uint8Array}} Grid packed: zlib of the int8 cells, lowest y first */
/** @typedef {{type: "path", key: string, points: Float32Array}} Path x, y pairs in map */
/** @typedef {{type: "posearray", key: string, poses: Float32Array}} PoseArray x, y, yaw triples in map */
/** @typedef {{type: "samples", topic: string, field: string, times: Float64Array, values: Float64Array}} Samples */
/** @typedef {Poses | Scan | Doc | Grid | Path | PoseArray | Samples} Block */

/** A frame that is not as agreed. */
export class WireError extends Error {}

/**
 * @param {ArrayBuffer} buffer
 * @returns {Frame} blocks of unknown types are left out
 */
export function decodeFrame(buffer) {
  if (buffer.byteLength < HEADER) throw new WireError(`a frame has ${buffer.byteLength} bytes, not ${HEADER} or more`);
  const view = new DataView(buffer);
  const kind = view.getUint8(0),
    version = view.getUint8(1);
  if (kind !== 1 || version !== VERSION) {
    throw new WireError(`frame of kind ${kind}, version ${version}: reload the page`);
  }
  const count = view.getUint16(2, true);
  /** @type {Block[]} */
  const blocks = [];
  let at = HEADER;
  for (let i = 0; i < count; i++) {
    if (at + 8 > buffer.byteLength) throw new WireError(`block ${i} of ${count} begins after the end`);
    const length = view.getUint32(at + 4, true),
      body = at + 8;
    if (body + length > buffer.byteLength) throw new WireError(`block ${i} of ${count} ends after the end`);
    const block = decodeBlock(view, at, body, length);
    if (block) blocks.push(block);
    at = body + align(length, 8);
  }
  return {
    number: view.getUint32(4, true),
    tick: Number(view.getBigUint64(8, true)),
    stamp: view.getFloat64(16, true),
    age: view.getFloat64(24, true),
    blocks,
  };
}

/**
 * @param {DataView} view @param {number} at of the block @param {number} body its place @param {number} length
 * @returns {Block | null}
 */
function decodeBlock(view, at, body, length) {
  const part = new DataView(view.buffer, body, length);
  const flags = view.getUint8(at + 1),
    id = view.getUint16(at + 2, true);
  try {
    switch (view.getUint8(at)) {
      case POSES:
        return decodePoses(part, flags);
      case SCAN:
        return decodeScan(part, id);
      case DOC:
        return decodeDoc(part);
      case GRID:
        return decodeGrid(part);
      case PATH:
        return decodePath(part);
      case POSE_ARRAY:
        return decodePoseArray(part);
      case SAMPLES:
        return decodeSamples(part);
      default:
        return null;
    }
  } catch (error) {
    throw new WireError(`block of type ${view.getUint8(at)}: ${error}`);
  }
}

/** @param {DataView} body @param {number} flags @returns {Poses} */
function decodePoses(body, flags) {
  const originX = body.getFloat32(0, true),
    originY = body.getFloat32(4, true),
    step = body.getFloat32(8, true);
  const n = body.getUint32(12, true);
  const ids = new Uint16Array(body.buffer, body.byteOffset + 16, n);
  const numbers = new Int16Array(body.buffer, body.byteOffset + 16 + align(2 * n, 4), 3 * n);
  const x = new Float32Array(n),
    y = new Float32Array(n),
    yaw = new Float32Array(n);
  for (let i = 0; i < n; i++) {
    x[i] = originX + numbers[i] * step;
    y[i] = originY + numbers[n + i] * step;
    yaw[i] = numbers[2 * n + i] * YAW_STEP;
  }
  return { type: "poses", truth: (flags & 1) !== 0, ids, x, y, yaw };
}

/** @param {DataView} body @param {number} robot @returns {Scan} */
function decodeScan(body, robot) {
  /** @param {number} i */
  const float = (i) => body.getFloat32(4 + 4 * i, true);
  return {
    type: "scan",
    robot,
    sensor: body.getUint16(0, true),
    x: float(0),
    y: float(1),
    yaw: float(2),
    angleMin: float(3),
    angleIncrement: float(4),
    rangeMax: float(5),
    step: float(6),
    ranges: new Uint16Array(body.buffer, body.byteOffset + 32, body.getUint16(2, true)),
  };
}

/** @param {DataView} body @returns {{head: string, end: number}} the text at the start, and where it ends */
function headOf(body) {
  const end = 2 + body.getUint16(0, true);
  return { head: text.decode(bytesOf(body, 2, end)), end };
}

/** @param {DataView} body @returns {Doc} */
function decodeDoc(body) {
  const { head, end } = headOf(body);
  return { type: "doc", name: head, value: JSON.parse(text.decode(bytesOf(body, end, body.byteLength))) };
}

/** @param {DataView} body @returns {Grid} */
function decodeGrid(body) {
  const { head, end } = headOf(body);
  return { type: "grid", meta: JSON.parse(head), packed: bytesOf(body, end, body.byteLength) };
}

/** @param {DataView} body @returns {Path} */
function decodePath(body) {
  const { head, end } = headOf(body);
  return { type: "path", key: JSON.parse(head).key, points: floatsOf(body, end, 2) };
}

/** @param {DataView} body @returns {PoseArray} */
function decodePoseArray(body) {
  const { head, end } = headOf(body);
  return { type: "posearray", key: JSON.parse(head).key, poses: floatsOf(body, end, 3) };
}

/** @param {DataView} body @returns {Samples} */
function decodeSamples(body) {
  const { head, end } = headOf(body);
  const { topic, field } = JSON.parse(head),
    start = align(end, 8);
  const n = Math.floor((body.byteLength - start) / 16);
  const pairs = new Float64Array(body.buffer, body.byteOffset + start, 2 * n);
  const times = new Float64Array(n),
    values = new Float64Array(n);
  for (let i = 0; i < n; i++) {
    times[i] = pairs[2 * i];
    values[i] = pairs[2 * i + 1];
  }
  return { type: "samples", topic, field, times, values };
}

/** @param {DataView} body @param {number} end of the head @param {number} size numbers an item */
function floatsOf(body, end, size) {
  const start = align(end, 4),
    count = Math.floor((body.byteLength - start) / (4 * size));
  return new Float32Array(body.buffer, body.byteOffset + start, count * size);
}

/** @param {DataView} body @param {number} start @param {number} end */
function bytesOf(body, start, end) {
  return new Uint8Array(body.buffer, body.byteOffset + start, end - start);
}

/** @param {number} value @param {number} step */
function align(value, step) {
  return Math.ceil(value / step) * step;
}

/**
 * @param {Uint8Array} packed zlib
 * @returns {Promise<Int8Array>}
 */
export async function unpack(packed) {
  const stream = new Blob([/** @type {BlobPart} */ (packed)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Int8Array(await new Response(stream).arrayBuffer());
}
