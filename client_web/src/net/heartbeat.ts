/** Notices that a server no longer answers. After some quiet it asks; a lost network closes no socket by itself. */

const TICK_MS = 500;
/** So long nothing may come before the server is asked. */
const QUIET_MS = 2000;
/** So long an answer may take before the silence is said. */
const PATIENCE_MS = 2000;
/** So long it may take at all: a large picture on a slow line holds up the answer behind it. */
const LOST_MS = 20_000;

export interface HeartbeatHandlers {
  ask(): void;
  /** No answer for a while. */
  silent(): void;
  /** An answer after a silence. */
  answered(): void;
  /** No answer for so long that another connection is better. */
  lost(): void;
}

export class Heartbeat {
  private timer: ReturnType<typeof setInterval> | undefined;
  private heardTime = 0;
  private askedTime: number | null = null;
  /** Whether the silence was said. */
  isSilent = false;

  constructor(private readonly handlers: HeartbeatHandlers) {}

  start(): void {
    this.stop();
    this.heardTime = performance.now();
    this.timer = setInterval(() => this.tick(), TICK_MS);
  }

  stop(): void {
    clearInterval(this.timer);
    this.timer = undefined;
    this.askedTime = null;
    this.isSilent = false;
  }

  /** Something came. */
  heard(): void {
    this.heardTime = performance.now();
    this.askedTime = null;
    if (!this.isSilent) return;
    this.isSilent = false;
    this.handlers.answered();
  }

  /** Ask now: there is reason to doubt the connection. */
  check(): void {
    if (this.timer === undefined || this.askedTime !== null) return;
    this.askedTime = performance.now();
    this.handlers.ask();
  }

  /** Silence counts from the question, so that a timer that slept says nothing by itself. */
  private tick(): void {
    const now = performance.now();
    if (this.askedTime === null) {
      if (now - this.heardTime >= QUIET_MS) this.check();
    } else if (now - this.askedTime >= LOST_MS) {
      this.handlers.lost();
    } else if (!this.isSilent && now - this.askedTime >= PATIENCE_MS) {
      this.isSilent = true;
      this.handlers.silent();
    }
  }
}
