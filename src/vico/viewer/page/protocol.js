// Frames as docs/viewer_protocol.md lays them out: decoded without copies, into columns.

/** @typedef {Record<string, Int32Array | Uint8Array | Int8Array>} Columns */
/**
 * @typedef {object} Frame
 * @property {number} step
 * @property {number} time seconds since midnight of the first day
 * @property {number} flags
 * @property {number} range
 * @property {Float32Array} sky
 * @property {Columns} bodies
 * @property {Columns} people
 * @property {Columns} agents
 * @property {Columns} robots
 * @property {Columns} joints
 * @property {Columns} doors
 * @property {Record<string, Map<number, number>>} rows row of each entity, by table
 */

const INT = 4;
const BYTE = 1;
const SIGNED = -1;
/** @type {[string, [string, number][]][]} */
const TABLES = [
  ["bodies", [["entity", INT], ["x", INT], ["y", INT], ["z", INT], ["yaw", INT], ["speed", INT], ["lights", BYTE]]],
  [
    "people",
    [
      ["entity", INT], ["phase", INT], ["pace", INT], ["phase_before", INT], ["pace_before", INT], ["clip_time", INT],
      ["clip", SIGNED], ["clip_before", SIGNED], ["hold", SIGNED], ["hold_share", SIGNED],
    ],
  ],
  [
    "agents",
    [
      ["entity", INT], ["pitch", INT], ["room", INT], ["place", INT], ["vehicle", INT], ["held_left", INT],
      ["held_right", INT], ["cash", INT], ["posture", SIGNED], ["status", SIGNED],
    ],
  ],
  ["robots", [["entity", INT], ["x", INT], ["y", INT], ["z", INT], ["qw", INT], ["qx", INT], ["qy", INT], ["qz", INT]]],
  ["joints", [["entity", INT], ["joint", INT], ["angle", INT]]],
  ["doors", [["entrance", INT], ["share", SIGNED]]],
];
const HEAD = 40;
const SKY = 16;
/** Names of the numbers of the sky. */
export const SKY_FIELDS = [
  "sun_x", "sun_y", "sun_z", "darkness", "clouds", "rain", "snow", "visibility", "wind", "wind_from", "temperature",
  "wet", "snow_cover", "ice", "lamps", "spare",
];

/**
 * Decode one frame.
 * @param {ArrayBuffer} buffer
 * @param {number} [start] where it begins, a multiple of four
 * @returns {Frame}
 */
export function decodeFrame(buffer, start = 0) {
  const head = new DataView(buffer, start);
  if (head.getUint8(0) !== 0x56 || head.getUint8(1) !== 2) throw new Error("no frame of version 2");
  /** @type {any} */
  const frame = {
    flags: head.getUint8(2),
    step: head.getUint32(4, true),
    time: head.getFloat64(8, true),
    range: head.getUint32(36, true),
    sky: new Float32Array(buffer, start + HEAD, SKY),
    rows: {},
  };
  let at = start + HEAD + 4 * SKY;
  TABLES.forEach(([name, columns], k) => {
    const count = name === "doors" ? head.getUint8(3) : head.getUint32(16 + 4 * k, true);
    /** @type {Columns} */
    const found = {};
    for (const [key, kind] of columns) {
      if (kind === INT) {
        found[key] = new Int32Array(buffer, at, count);
        at += 4 * count;
      } else {
        found[key] = kind === BYTE ? new Uint8Array(buffer, at, count) : new Int8Array(buffer, at, count);
        at += (count + 3) & ~3;
      }
    }
    frame[name] = found;
    if (found.entity && name !== "joints") frame.rows[name] = rowsOf(found.entity);
  });
  return frame;
}

/** @param {any} entity @returns {Map<number, number>} */
function rowsOf(entity) {
  const rows = new Map();
  for (let k = 0; k < entity.length; k++) rows.set(entity[k], k);
  return rows;
}

/**
 * Decode frames that follow each other, each after its length.
 * @param {ArrayBuffer} buffer
 * @returns {Frame[]}
 */
export function decodeFrames(buffer) {
  const view = new DataView(buffer);
  const frames = [];
  for (let at = 0; at + 4 <= buffer.byteLength; ) {
    const size = view.getUint32(at, true);
    frames.push(decodeFrame(buffer, at + 4));
    at += 4 + size;
  }
  return frames;
}
