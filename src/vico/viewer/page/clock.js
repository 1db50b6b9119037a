// What time the page shows: it plays a recording, or keeps a little behind a run that goes on.

/** Seconds of the reader's own time that a live picture is late, so that it can lie between two steps. */
const LATE = 0.1;

export class Clock {
  constructor() {
    /** Seconds since midnight of the first day. */
    this.time = 0;
    this.first = 0;
    this.last = 0;
    this.playing = false;
    this.speed = 1;
    /** Whether to stay at the newest step of a run that goes on. */
    this.following = false;
    /** Whether that run is held up. */
    this.held = false;
    /** Simulated seconds a second, of a live run. */
    this.factor = 1;
    this._arrived = 0;
    this._gap = 1;
  }

  /**
   * The newest step was received.
   * @param {number} time
   * @param {number} now milliseconds
   */
  arrived(time, now) {
    if (time > this.last) {
      const passed = (now - this._arrived) / 1000;
      if (this._arrived && passed > 0.005 && passed < 5) {
        this._gap += ((time - this.last) - this._gap) * 0.2;
        this.factor += ((time - this.last) / passed - this.factor) * 0.1;
      }
      this._arrived = now;
    }
    this.last = Math.max(this.last, time);
  }

  /**
   * Advance by some of the reader's own seconds.
   * @param {number} seconds
   * @returns {number} the time shown now
   */
  advance(seconds) {
    if (this.following) {
      // Behind the newest step there is something to come; of a run that is held up there is not.
      const wanted = this.held ? this.last : this.last - this._gap - LATE * Math.max(this.factor, 0.1);
      const away = wanted - this.time;
      // Far away: jump. Nearby: go at the run's own speed, a little faster or slower until it fits.
      if (Math.abs(away) > Math.max(4 * this._gap, 3 * this.factor)) this.time = wanted;
      else this.time = Math.min(this.time + Math.max(0, (this.held ? 0.5 : this.factor) + away) * seconds, this.last);
    } else if (this.playing) {
      this.time += this.speed * seconds;
      if (this.time >= this.last) {
        this.time = this.last;
        this.playing = false;
      }
    }
    this.time = Math.max(this.first, this.time);
    return this.time;
  }

  /** @param {number} time */
  seek(time) {
    this.following = false;
    this.time = Math.min(Math.max(time, this.first), this.last);
  }
}

/** @param {number} seconds @returns {string} HH:MM:SS, and the day where it is not the first */
export function clockText(seconds) {
  const whole = Math.floor(seconds + 1e-6);
  const two = (/** @type {number} */ n) => String(n).padStart(2, "0");
  const day = Math.floor(whole / 86400);
  return `${day > 0 ? `day ${day + 1} ` : ""}${two(Math.floor(whole / 3600) % 24)}:${two(Math.floor(whole / 60) % 60)}:${two(whole % 60)}`;
}
