/** Detects an unresponsive server by pings after a silence; a lost network does not close a socket. */

const TICK_MS = 500;
/** Silence before a ping. */
const QUIET_MS = 2000;
/** Time without a response before the silence is reported. */
const SILENCE_MS = 2000;
/** Maximum time for a response: a large image on a slow connection delays it. */
const TIMEOUT_MS = 20_000;

export interface HeartbeatHandlers {
  sendPing: () => void;
  /** No response for a while. */
  onSilent: () => void;
  /** A response after a reported silence. */
  onAnswered: () => void;
  /** No response for so long that reconnecting is better. */
  onLost: () => void;
}

export class Heartbeat {
  private timer: ReturnType<typeof setInterval> | undefined;
  private lastActivityTime = 0;
  private pingTime: number | null = null;
  /** True if the silence was reported. */
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

  /** Record an incoming message. */
  recordActivity(): void {
    this.lastActivityTime = performance.now();
    this.pingTime = null;
    if (!this.isSilent) return;
    this.isSilent = false;
    this.handlers.onAnswered();
  }

  /** Ping now: the connection may be lost. */
  check(): void {
    if (this.timer === undefined || this.pingTime !== null) return;
    this.pingTime = performance.now();
    this.handlers.sendPing();
  }

  /** Silence counts from the ping, so that a suspended timer alone reports nothing. */
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
