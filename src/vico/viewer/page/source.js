// Where the page has a run from: the server's routes, its WebSocket, and the frames fetched so far.

import { decodeFrame, decodeFrames } from "./protocol.js";

/** @typedef {import("./protocol.js").Frame} Frame */

const CHUNK = 60;
/** Frames kept: an hour of steps of ten kilobytes. */
const KEPT = 3600;
const NEWEST = 2;

export class Source extends EventTarget {
  constructor() {
    super();
    /** @type {any} */
    this.run = null;
    /** @type {Map<number, any>} */
    this.cast = new Map();
    /** @type {Map<number, Frame>} */
    this.frames = new Map();
    /** @type {Set<number>} */
    this._fetching = new Set();
    /** @type {WebSocket | null} */
    this.socket = null;
    this._id = 1;
    /** @type {Map<number, (reply: any) => void>} */
    this._waiting = new Map();
    this.connected = false;
    this._delay = 500;
    this._closed = false;
  }

  async open() {
    await this.reload();
    this._connect();
  }

  /** Ask anew what run this is. */
  async reload() {
    this.run = await getJson("api/run");
    // A recording is shown without its world as well.
    this.run.world ??= { name: "world not found", places: [], rooms: [] };
    await this.loadCast();
  }

  async loadCast() {
    const { cast } = await getJson("api/cast");
    this.takeCast(cast);
  }

  /** @param {any[]} cast */
  takeCast(cast) {
    for (const member of cast) this.cast.set(member.entity, member);
    this._tell("cast", cast);
  }

  get last() {
    return this.run.run.last;
  }

  get live() {
    return Boolean(this.run.live);
  }

  /** @param {number} step @returns {number} */
  timeOf(step) {
    const pieces = this.run.pieces;
    let piece = pieces[0];
    for (const other of pieces) if (other.first <= step) piece = other;
    return piece.time + (step - piece.first) * piece.period;
  }

  /** @param {number} time @returns {number} the step at a time, with the share of the next */
  stepAt(time) {
    const pieces = this.run.pieces;
    let piece = pieces[0];
    for (const other of pieces) if (other.time <= time + 1e-9) piece = other;
    return Math.min(Math.max(piece.first + (time - piece.time) / piece.period, 0), this.last);
  }

  /**
   * The frames around a place, as far as they have come; asks for those that are missing, and a few that follow.
   * @param {number} place a step and the share of the next
   * @returns {[Frame | null, Frame | null, number]} before, after, and the share between
   */
  around(place) {
    const before = Math.floor(place + 1e-6);
    const after = Math.min(before + 1, this.last);
    this._want(before);
    this._want(after);
    if ((before % CHUNK) > CHUNK / 2) this._want(Math.min(before + CHUNK / 2 + 1, this.last));
    return [this.frames.get(before) ?? null, this.frames.get(after) ?? null, place - before];
  }

  /** @param {number} step */
  _want(step) {
    if (this.frames.has(step)) return;
    const chunk = Math.floor(step / CHUNK);
    if (this._fetching.has(chunk)) return;
    this._fetching.add(chunk);
    const first = chunk * CHUNK;
    const last = Math.min(first + CHUNK - 1, this.last);
    fetch(`api/frames?first=${first}&last=${last}`)
      .then(async (answer) => {
        if (!answer.ok) throw new Error(await answer.text());
        for (const frame of decodeFrames(await answer.arrayBuffer())) this._keep(frame);
        this._tell("frames", null);
      })
      .catch(() => {})
      .finally(() => {
        // A chunk that was cut short at the newest step is asked for again when more is there.
        setTimeout(() => this._fetching.delete(chunk), 400);
      });
  }

  /** @param {Frame} frame */
  _keep(frame) {
    this.frames.set(frame.step, frame);
    if (this.frames.size > KEPT) {
      const oldest = this.frames.keys().next().value;
      if (oldest !== undefined) this.frames.delete(oldest);
    }
  }

  _connect() {
    // Beside the page, wherever a forwarded port or a proxy has put that.
    const address = new URL("stream", document.baseURI);
    address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.connected = true;
      this._delay = 500;
      this._tell("connection", true);
      if (this.live) this.send({ type: "follow", rate: 20 });
    };
    socket.onmessage = (message) => this._receive(message.data);
    socket.onclose = () => {
      const was = this.connected;
      this.connected = false;
      for (const answer of this._waiting.values()) answer({ ok: false, error: "the connection was lost" });
      this._waiting.clear();
      if (was) this._tell("connection", false);
      if (this._closed) return;
      // A server that was started again has the same address: the page finds it by itself.
      setTimeout(() => this._reconnect(), this._delay);
      this._delay = Math.min(this._delay * 1.6, 5000);
    };
  }

  async _reconnect() {
    try {
      await this.reload();
    } catch {
      setTimeout(() => this._reconnect(), this._delay);
      this._delay = Math.min(this._delay * 1.6, 5000);
      return;
    }
    this.frames.clear();
    this._connect();
  }

  /** @param {string | ArrayBuffer} data */
  _receive(data) {
    if (typeof data !== "string") {
      const frame = decodeFrame(data);
      this._keep(frame);
      if (frame.step > this.last) this.run.run.last = frame.step;
      if (frame.flags & NEWEST) this._tell("newest", frame);
      return;
    }
    const message = JSON.parse(data);
    if (message.type === "reply") {
      if (message.bookmarks) this.run.bookmarks = message.bookmarks;
      this._waiting.get(message.id)?.(message);
      this._waiting.delete(message.id);
    } else if (message.type === "cast") this.takeCast(message.cast);
    else if (message.type === "run") {
      this.frames.clear();
      this.reload().then(() => this._tell("run", message));
    } else if (message.type === "control") {
      this.run.control = { ...(this.run.control ?? {}), ...message };
      this._tell("control", message);
    } else this._tell(message.type, message);
  }

  /** @param {object} message */
  send(message) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  /** @param {string} name @returns {boolean} whether the server understands a command */
  can(name) {
    return Boolean(this.run.control?.can?.includes(name)) && this.connected;
  }

  /**
   * Lay hands on the run.
   * @param {string} command
   * @param {object} [values]
   * @returns {Promise<any>} the reply: `ok`, `error`
   */
  command(command, values = {}) {
    const id = this._id++;
    return new Promise((resolve) => {
      if (this.socket?.readyState !== WebSocket.OPEN) {
        resolve({ ok: false, error: "there is no connection to the run" });
        return;
      }
      this._waiting.set(id, resolve);
      this.send({ type: "command", id, command, arguments: values });
    });
  }

  /** @param {string} name @param {any} detail */
  _tell(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }
}

/** @param {string} path @returns {Promise<any>} */
export async function getJson(path) {
  const answer = await fetch(path);
  const content = await answer.json().catch(() => ({}));
  if (!answer.ok) throw new Error(content.error ?? `${path}: ${answer.status}`);
  return content;
}
