/** The transport of a live session: a WebSocket that connects again by itself, with the token that finds its look. */
import { ROOM_PREFIX, SUBPROTOCOL, type ClientMessage, type OpenMessage } from "../protocol";
import { backoffMs } from "./backoff";
import { Heartbeat } from "./heartbeat";

/** Nobody has logged in, or may no longer be here. */
export const LOGIN_CODE = 4401;
/** Another version of the protocol, no such bake, not ready, damaged: trying again gives the same. */
const FINAL_CODES = new Set([1002, LOGIN_CODE, 4403, 4404, 4409, 4410]);
/** As many sessions or people as may be, or nobody in a room yet: later there may be room. */
const BUSY_CODE = 1013;
/** A token that was refused so often is not tried for ever. */
const MAX_RESUMES = 3;

/** `silent`: the connection is there, and nothing comes over it. */
export type Connection = "connecting" | "open" | "silent" | "reconnecting" | "closed";

/** With what a session is to begin, and in which room. */
export type Asked = () => Readonly<Omit<OpenMessage, "type" | "resume">>;

export interface SocketHandlers {
  /** `reason`: what the server said where it has no room now. */
  connection(state: Connection, retryInMs: number, reason?: string): void;
  received(data: string | ArrayBuffer): void;
  /** The server will not have this session again; no use in trying. */
  ended(reason: string, code: number): void;
}

export class LiveSocket {
  private socket: WebSocket | null = null;
  /** How many connections there have been: what came over one is no longer known over the next. */
  number = 0;
  private attempt = 0;
  private retry = 0;
  private greeted = false;
  private closed = false;
  /** Names this session to the server, so that a lost connection finds its look again. */
  private resume: string | null = null;
  private readonly heartbeat = new Heartbeat({
    ask: () => void this.send({ type: "ping" }),
    silent: () => this.handlers.connection("silent", 0),
    answered: () => this.handlers.connection("open", 0),
    lost: () => this.leave(),
  });

  constructor(
    readonly bake: string,
    private readonly handlers: SocketHandlers,
    /** What is asked of the server with each connection. */
    private readonly asked: Asked = () => ({}),
  ) {}

  connect(): void {
    this.handlers.connection(this.attempt === 0 ? "connecting" : "reconnecting", 0);
    const url = new URL(`/api/bakes/${encodeURIComponent(this.bake)}/session`, location.href);
    url.protocol = url.protocol.replace("http", "ws");
    // all else is said in a message: addresses are written into logs
    const opening: OpenMessage = { type: "open", ...this.asked(), resume: this.resume };
    const room = opening.room ?? opening.watch;
    if (room != null) url.searchParams.set("room_prefix", room.slice(0, ROOM_PREFIX));
    this.socket?.close(1000); // one that hangs while it connects
    const socket = new WebSocket(url, SUBPROTOCOL);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => socket.send(JSON.stringify(opening));
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (socket !== this.socket) return; // it was left for another one
      this.heartbeat.heard();
      this.handlers.received(event.data);
    };
    socket.onclose = (event) => this.lost(socket, event);
    this.socket = socket;
    this.number += 1;
  }

  /** The server has said hello: messages may go, and `resume` names the session from now on. */
  greet(resume: string): void {
    this.attempt = 0;
    this.greeted = true;
    this.heartbeat.start();
    this.resume = resume;
  }

  private lost(socket: WebSocket, event: Pick<CloseEvent, "code" | "reason">): void {
    if (this.closed || socket !== this.socket) return;
    this.greeted = false;
    this.heartbeat.stop();
    this.socket = null;
    if (FINAL_CODES.has(event.code)) {
      this.close();
      this.handlers.ended(event.reason || `code ${event.code}`, event.code);
      return;
    }
    const wait = backoffMs(this.attempt++);
    if (this.attempt > MAX_RESUMES) this.resume = null;
    this.handlers.connection("reconnecting", wait, event.code === BUSY_CODE ? event.reason : undefined);
    this.retry = window.setTimeout(() => this.connect(), wait);
  }

  /** Leave the connection, and try until the server, or another in its place, is there. */
  leave(): void {
    const leaving = this.socket;
    if (leaving === null || this.closed) return;
    leaving.close(1000);
    this.lost(leaving, { code: 1012, reason: "" });
  }

  /** Try at once instead of waiting for the backoff. */
  reconnectNow(): void {
    if (this.closed) return;
    if (this.heartbeat.isSilent) this.leave();
    if (this.greeted) return;
    clearTimeout(this.retry);
    this.connect();
  }

  /** Ask the server whether it is still there. */
  check(): void {
    this.heartbeat.check();
  }

  get isOpen(): boolean {
    return this.greeted && this.socket?.readyState === WebSocket.OPEN;
  }

  /** Bytes that wait in the browser. */
  get bufferedBytes(): number {
    return this.socket?.bufferedAmount ?? 0;
  }

  /** Whether the message went. */
  send(message: ClientMessage): boolean {
    if (!this.isOpen) return false;
    this.socket?.send(JSON.stringify(message));
    return true;
  }

  close(): void {
    this.closed = true;
    this.greeted = false;
    this.heartbeat.stop();
    clearTimeout(this.retry);
    this.socket?.close(1000);
    this.handlers.connection("closed", 0);
  }
}
