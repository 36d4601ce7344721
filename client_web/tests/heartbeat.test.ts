/** A server that no longer answers, on a connection that nobody closed. */
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { SessionSocket } from "../src/session/net/socket";

class FakeSocket {
  static readonly OPEN = 1;
  static opened: FakeSocket[] = [];
  readyState = FakeSocket.OPEN;
  sent: string[] = [];
  onmessage: (event: { data: string }) => void = () => undefined;
  onclose: (event: { code: number; reason: string }) => void = () => undefined;

  constructor() {
    FakeSocket.opened.push(this);
  }

  send(text: string): void {
    this.sent.push(text);
  }

  close(): void {
    this.readyState = 3;
  }
}

const PING = '{"type":"ping"}';
const connection = vi.fn();
const newest = () => FakeSocket.opened.at(-1) as FakeSocket;
let socket: SessionSocket;

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal("WebSocket", FakeSocket);
  vi.stubGlobal("location", { href: "http://example.org/" });
  vi.stubGlobal("window", globalThis);
  FakeSocket.opened = [];
  connection.mockClear();
  socket = new SessionSocket("bake", { connection, received: () => undefined, ended: () => undefined });
  socket.connect();
  socket.onHello("token");
  connection.mockClear();
});

afterEach(() => {
  socket.close();
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

test("a server that talks is not asked", () => {
  for (let k = 0; k < 10; k++) {
    vi.advanceTimersByTime(1000);
    newest().onmessage({ data: "{}" });
  }
  expect(newest().sent).toEqual([]);
  expect(connection).not.toHaveBeenCalled();
});

test("a quiet one is asked, and its answer is enough", () => {
  for (let k = 0; k < 3; k++) {
    vi.advanceTimersByTime(2500);
    expect(newest().sent).toHaveLength(k + 1);
    newest().onmessage({ data: '{"type":"pong"}' });
  }
  expect(new Set(newest().sent)).toEqual(new Set([PING]));
  expect(connection).not.toHaveBeenCalled();
});

test("no answer is said within five seconds, once, and taken back when one comes", () => {
  for (let k = 0; k < 2; k++) {
    connection.mockClear();
    vi.advanceTimersByTime(5000);
    expect(connection.mock.calls).toEqual([["silent", 0]]);
    newest().onmessage({ data: '{"type":"pong"}' });
    expect(connection.mock.lastCall).toEqual(["open", 0]);
  }
  expect(FakeSocket.opened).toHaveLength(1);
});

test("a long silence ends the connection, and another one is tried", () => {
  vi.advanceTimersByTime(30_000);
  expect(connection.mock.calls.map(([state]) => state as string)).toContain("reconnecting");
  expect(FakeSocket.opened.length).toBeGreaterThan(1);
  expect(FakeSocket.opened[0]?.readyState).toBe(3);
});

test("when the network is back, a silent connection is left at once, and a good one is not", () => {
  socket.reconnectNow();
  expect(FakeSocket.opened).toHaveLength(1);
  vi.advanceTimersByTime(5000);
  socket.reconnectNow();
  expect(FakeSocket.opened).toHaveLength(2);
  FakeSocket.opened[0]?.onmessage({ data: "{}" }); // late
  expect(connection.mock.lastCall?.[0]).not.toBe("open");
});

test("reason to doubt the connection asks at once", () => {
  socket.checkConnection();
  socket.checkConnection();
  expect(newest().sent).toEqual([PING]);
  vi.advanceTimersByTime(2500);
  expect(connection.mock.calls).toEqual([["silent", 0]]);
});
