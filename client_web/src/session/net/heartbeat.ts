/** Notices that a server no longer answers. After some quiet it asks; a lost network closes no socket by itself. */

const TICK_MS = 500;
/** So long nothing may come before the server is asked. */
const QUIET_MS = 2000;
/** Time without an answer before the silence is shown. */
const SILENCE_MS = 2000;
/** So long it may take at all: a large image on a slow line holds up the answer behind it. */
const TIMEOUT_MS = 20_000;

export interface HeartbeatHandlers {
  sendPing(): void;
  /** No answer for a while. */
  onSilent(): void;
  /** An answer after a silence. */
  onAnswered(): void;
  /** No answer for so long that another connection is better. */
  onLost(): void;
}

export class Heartbeat {
  private timer: ReturnType<typeof setInterval> | undefined;
  private lastActivityTime = 0;
  private pingTime: number | null = null;
  /** Whether the silence was said. */
  isSilent = false;

  constructor(private readonly handlers: HeartbeatHandlers) {}

  start(): void {
    this.stop();
    this.lastActivityTime = performance.now();
    this.timer = setInterval(() => this.tick(), TICK_MS);
  }

  stop(): void {
    clearInterval(this.timer);
    this.timer = undefined;
    this.pingTime = null;
    this.isSilent = false;
  }

  /** Something came. */
  recordActivity(): void {
    this.lastActivityTime = performance.now();
    this.pingTime = null;
    if (!this.isSilent) return;
    this.isSilent = false;
    this.handlers.onAnswered();
  }

  /** Ask now: there is reason to doubt the connection. */
  check(): void {
    if (this.timer === undefined || this.pingTime !== null) return;
    this.pingTime = performance.now();
    this.handlers.sendPing();
  }

  /** Silence counts from the question, so that a timer that slept says nothing by itself. */
  private tick(): void {
    const now = performance.now();
    if (this.pingTime === null) {
      if (now - this.lastActivityTime >= QUIET_MS) this.check();
    } else if (now - this.pingTime >= TIMEOUT_MS) {
      this.handlers.onLost();
    } else if (!this.isSilent && now - this.pingTime >= SILENCE_MS) {
      this.isSilent = true;
      this.handlers.onSilent();
    }
  }
}
