// Vectors and rotations as plain numbers: no library is needed to pose somebody.

/** @typedef {number[]} Vector */
/** @typedef {number[]} Quaternion x, y, z, w */

/** @param {number} t */
export function smoothstep(t) {
  const x = Math.min(Math.max(t, 0), 1);
  return x * x * (3 - 2 * x);
}

/** @param {number} x */
export function clamp(x) {
  return Math.min(Math.max(x, -1), 1);
}

/** @param {Quaternion} a @param {Quaternion} b @returns {Quaternion} */
export function compose([ax, ay, az, aw], [bx, by, bz, bw]) {
  return [aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx, aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz];
}

/** @param {Quaternion} q @returns {Quaternion} */
export function inverse([x, y, z, w]) {
  return [-x, -y, -z, w];
}

/** @param {Quaternion} q @param {Vector} v @returns {Vector} */
export function rotate([x, y, z, w], [a, b, c]) {
  const [p, q, r] = [y * c - z * b, z * a - x * c, x * b - y * a];
  return [a + 2 * (w * p + y * r - z * q), b + 2 * (w * q + z * p - x * r), c + 2 * (w * r + x * q - y * p)];
}

/** @param {Vector} a @param {Vector} b @returns {Vector} */
export function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

/** @param {Vector} a @param {Vector} b */
export function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** @param {Vector} v @returns {Vector} */
export function unit(v) {
  const n = Math.max(Math.hypot(...v), 1e-12);
  return v.map((x) => x / n);
}

/** @param {Vector} a @param {Vector} b @returns {Vector} */
export function minus(a, b) {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

/** @param {Quaternion} a @param {Quaternion} b @param {number} t @returns {Quaternion} a share of the way from one to another */
export function partWay(a, b, t) {
  const from = Float32Array.from(a);
  const to = Float32Array.from(b);
  turnBack(from, to, t);
  return [...to];
}

/** @param {Vector} x @param {Vector} y @param {Vector} z @returns {Quaternion} the rotation that has these axes */
export function ofAxes(x, y, z) {
  const trace = x[0] + y[1] + z[2];
  if (trace > 0) {
    const s = 2 * Math.sqrt(trace + 1);
    return [(y[2] - z[1]) / s, (z[0] - x[2]) / s, (x[1] - y[0]) / s, s / 4];
  }
  if (x[0] > y[1] && x[0] > z[2]) {
    const s = 2 * Math.sqrt(1 + x[0] - y[1] - z[2]);
    return [s / 4, (y[0] + x[1]) / s, (z[0] + x[2]) / s, (y[2] - z[1]) / s];
  }
  if (y[1] > z[2]) {
    const s = 2 * Math.sqrt(1 + y[1] - x[0] - z[2]);
    return [(y[0] + x[1]) / s, s / 4, (z[1] + y[2]) / s, (z[0] - x[2]) / s];
  }
  const s = 2 * Math.sqrt(1 + z[2] - x[0] - y[1]);
  return [(z[0] + x[2]) / s, (z[1] + y[2]) / s, s / 4, (x[1] - y[0]) / s];
}

/**
 * Turn every rotation of `to` back towards `from`: `share` of the way from there is left.
 * @param {Float32Array} from
 * @param {Float32Array} to changed
 * @param {number} share
 */
export function turnBack(from, to, share) {
  for (let j = 0; j < to.length; j += 4) {
    let x0 = from[j], y0 = from[j + 1], z0 = from[j + 2], w0 = from[j + 3];
    let dot = x0 * to[j] + y0 * to[j + 1] + z0 * to[j + 2] + w0 * to[j + 3];
    if (dot < 0) { x0 = -x0; y0 = -y0; z0 = -z0; w0 = -w0; dot = -dot; }
    let a = 1 - share;
    let b = share;
    if (dot < 0.9995) {
      const angle = Math.acos(Math.min(dot, 1));
      const sine = Math.sin(angle);
      a = Math.sin((1 - share) * angle) / sine;
      b = Math.sin(share * angle) / sine;
    }
    const x = a * x0 + b * to[j], y = a * y0 + b * to[j + 1], z = a * z0 + b * to[j + 2], w = a * w0 + b * to[j + 3];
    const n = 1 / Math.sqrt(x * x + y * y + z * z + w * w);
    to[j] = x * n; to[j + 1] = y * n; to[j + 2] = z * n; to[j + 3] = w * n;
  }
}

/** @param {number} x */
export function fraction(x) {
  return x - Math.floor(x);
}
