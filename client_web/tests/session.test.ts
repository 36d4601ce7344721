/** A session over a socket that is made here: hello, edits, acknowledgements, losing the connection and finding it again. */
import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";
import { changeValue } from "../src/state/document/jsonPatch";
import { Session, type SessionHandlers } from "../src/session/net/session";
import type { ClientMessage, Look } from "../src/protocol";
import { LOOK, lookWith } from "./exampleLook";

const SIGMA = "/materials/Teapot/terms/1/params/sigma";

class FakeSocket {
  static readonly OPEN = 1;
  static opened: FakeSocket[] = [];
  readyState = FakeSocket.OPEN;
  bufferedAmount = 0;
  sent: ClientMessage[] = [];
  opening: ClientMessage | null = null;
  onopen: () => void = () => undefined;
  role: "view" | "edit" = "edit";
  onmessage: (event: { data: string | ArrayBuffer }) => void = () => undefined;
  onclose: (event: { code: number; reason: string }) => void = () => undefined;

  constructor(readonly url: URL) {
    FakeSocket.opened.push(this);
  }

  send(text: string): void {
    const message = JSON.parse(text) as ClientMessage;
    if (message.type === "open") this.opening = message;
    else this.sent.push(message);
  }

  close(): void {
    this.readyState = 3;
  }

  /** The server says something. */
  says(message: object): void {
    this.onmessage({ data: JSON.stringify(message) });
  }

  hello(look: Look, revision: number, resume = "token"): void {
    this.says({ type: "hello", look, revision, resume, solo: null, role: this.role, room: null });
  }

  get edits() {
    return this.sent.filter((message) => message.type === "edit");
  }
}

const handlers = {
  connection: vi.fn(),
  hello: vi.fn(),
  frame: vi.fn(() => Promise.resolve()),
  status: vi.fn(),
  problem: vi.fn(),
  inspect: vi.fn(),
  curve: vi.fn(),
  bake: vi.fn(),
  room: vi.fn(),
  comments: vi.fn(),
  path: vi.fn(),
  roomUpdate: vi.fn(),
  onEditSent: vi.fn(),
  readOnly: vi.fn(),
  ended: vi.fn(),
  invalidMessage: vi.fn(),
} satisfies SessionHandlers;

let nextFrame: (() => void)[];
let session: Session;
const socket = () => FakeSocket.opened.at(-1) as FakeSocket;

function animate(): void {
  for (const draw of nextFrame.splice(0)) draw();
}

/** The server says hello with the look that is wanted. */
function greet(): void {
  socket().hello(LOOK, 0);
  session.setTarget({ look: LOOK, activeControl: null, solo: null, inputTime: 0 });
  animate();
}

/** A frame without tiles, number 7. */
function frameOf(revision: number): ArrayBuffer {
  const header = new TextEncoder().encode(
    JSON.stringify({
      frame: 7,
      revision,
      view: "v",
      width: 1,
      height: 1,
      tiles: [],
      format: "rgb9e5",
      kind: "picture",
    }),
  );
  const bytes = new Uint8Array(4 + header.length);
  new DataView(bytes.buffer).setUint32(0, header.length, true);
  bytes.set(header, 4);
  return bytes.buffer;
}

/** Edit a look at this pointer, the active control. */
function edit(look: Look, path: string, value: unknown): Look {
  const change = changeValue(look, path, value);
  session.setTarget({ look: change.after, activeControl: path, solo: null, inputTime: 0 }, change);
  return change.after;
}

beforeEach(() => {
  vi.clearAllMocks();
  vi.useFakeTimers();
  FakeSocket.opened = [];
  nextFrame = [];
  vi.stubGlobal("WebSocket", FakeSocket);
  vi.stubGlobal("location", { href: "http://host/" });
  vi.stubGlobal("window", { setTimeout });
  vi.stubGlobal("requestAnimationFrame", (draw: () => void) => nextFrame.push(draw));
  session = new Session("b1", handlers);
  session.connect();
});

afterEach(() => {
  vi.useRealTimers();
});

test("the server's look that is the wanted one needs no edit", () => {
  session.setTarget({ look: LOOK, activeControl: null, solo: null, inputTime: 0 });
  expect(socket().url.href).toBe("ws://host/api/bakes/b1/session");
  socket().hello(structuredClone(LOOK), 0);
  expect(socket().sent).toEqual([]);
  expect(handlers.connection).toHaveBeenLastCalledWith("open", 0);
});

test("the first edit goes at once, more of them once in an animation frame", () => {
  greet();
  let look = edit(LOOK, SIGMA, 0.3);
  look = edit(look, SIGMA, 0.4);
  edit(look, SIGMA, 0.5);
  expect(socket().edits).toEqual([
    {
      type: "edit",
      revision: 1,
      patch: [{ op: "replace", path: SIGMA, value: 0.3 }],
      active_control: SIGMA,
      solo: null,
    },
  ]);
  animate();
  expect(socket().edits[1]).toMatchObject({ revision: 2, patch: [{ op: "replace", path: SIGMA, value: 0.5 }] });
});

test("another server in place of one that is gone knows of no edit: its first frame can be exact", () => {
  greet();
  const look = edit(LOOK, SIGMA, 0.3);
  expect(session.revision).toBe(1);
  socket().onclose({ code: 1006, reason: "" });
  vi.runOnlyPendingTimers();
  socket().hello(structuredClone(look), 0); // somebody else has brought it
  animate();
  expect(socket().edits).toEqual([]);
  expect(session.hasPendingEdits).toBe(false);
  expect(session.revision).toBe(0);
  edit(look, SIGMA, 0.4);
  animate();
  expect(socket().edits).toMatchObject([{ revision: 2 }]);
  expect(session.revision).toBe(2);
});

test("while two edits wait for a frame the next grows newer, until one comes or a tenth of a second has passed", () => {
  greet();
  let look = LOOK;
  const drag = (...values: number[]): void => {
    for (const value of values) {
      look = edit(look, SIGMA, value);
      animate();
    }
  };
  const sent = () => socket().edits.map(({ patch }) => patch[0]?.value);
  drag(0.3, 0.4, 0.5, 0.6);
  expect(sent()).toEqual([0.3, 0.4]);
  socket().onmessage({ data: frameOf(1) });
  animate();
  expect(sent()).toEqual([0.3, 0.4, 0.6]);
  drag(0.7);
  expect(session.sendAfterEdits({ type: "inspect", x: 1, y: 2 })).toBe(true);
  expect(sent()).toEqual([0.3, 0.4, 0.6, 0.7]);
  drag(0.8);
  vi.advanceTimersByTime(100);
  animate();
  expect(sent()).toEqual([0.3, 0.4, 0.6, 0.7, 0.8]);
});

test("who may only look sends no edits and takes hold of nothing", () => {
  socket().role = "view";
  socket().hello(LOOK, 0);
  const [{ look }] = handlers.hello.mock.lastCall as unknown as [{ look: Look }];
  edit(look, SIGMA, 0.3);
  animate();
  expect(handlers.readOnly).toHaveBeenCalledTimes(1);
  expect(session.hasPendingEdits).toBe(false);
  expect(session.send({ type: "prepare", parameter: SIGMA })).toBe(false);
  expect(session.send({ type: "prepare", curve: "/materials/A/terms/0/curves/theta_h" })).toBe(true); // to receive its values
  session.setTarget({ look, activeControl: null, solo: ["environment"], inputTime: 0 });
  expect(session.send({ type: "inspect", x: 1, y: 2 })).toBe(true);
  animate();
  const direct = { ...look.transport, show: "direct" as const };
  session.setTarget({ look: { ...look, transport: direct }, activeControl: null, solo: ["environment"], inputTime: 0 });
  animate();
  expect(handlers.readOnly).toHaveBeenCalledTimes(1);
  expect(socket().sent).toEqual([
    { type: "prepare", curve: "/materials/A/terms/0/curves/theta_h" },
    { type: "edit", revision: 1, patch: [], active_control: null, solo: ["environment"] },
    { type: "inspect", x: 1, y: 2 },
    {
      type: "edit",
      revision: 2,
      patch: [{ op: "replace", path: "/transport/show", value: "direct" }],
      active_control: null,
      solo: ["environment"],
    },
  ]);
});

test("a server that is being stopped is left, and the look goes to the one that comes", () => {
  greet();
  const left = socket();
  left.says({ type: "server_draining", seconds: 10 });
  expect(handlers.connection).toHaveBeenLastCalledWith("reconnecting", expect.any(Number), undefined);
  const look = edit(LOOK, SIGMA, 0.3);
  left.onclose({ code: 1000, reason: "" });
  vi.advanceTimersByTime(1000);
  expect(FakeSocket.opened).toHaveLength(2);
  socket().hello(LOOK, 0);
  session.setTarget({ look, activeControl: null, solo: null, inputTime: 0 });
  animate();
  expect(socket().edits.at(-1)).toMatchObject({ patch: [{ op: "replace", path: SIGMA, value: 0.3 }] });
  expect(left.edits).toEqual([]);
});

test("a session begins with what it is asked to, each time it connects", () => {
  new Session("b1", handlers, () => ({ look: "Red & blue" })).connect();
  socket().onopen();
  expect(socket().opening).toEqual({ type: "open", look: "Red & blue", resume: null });
  expect(socket().url.href).toBe("ws://host/api/bakes/b1/session");
});

test("of a room the address has what finds its server, and nothing that opens it", () => {
  const room = "0123456789abcdef0123456789abcdef";
  for (const parameters of [{ room, participant_token: "s" }, { view_token: room }]) {
    new Session("b1", handlers, () => parameters).connect();
    socket().onopen();
    expect(socket().opening).toEqual({ type: "open", ...parameters, resume: null });
    expect(socket().url.href).toBe("ws://host/api/bakes/b1/session?room_prefix=01234567");
  }
});

test("a frame is acknowledged when it is on the screen", async () => {
  let drawn: () => void = () => undefined;
  handlers.frame.mockReturnValueOnce(new Promise((done) => (drawn = done)));
  socket().hello(LOOK, 0);
  socket().onmessage({ data: frameOf(0) });
  expect(socket().sent).toEqual([]);
  drawn();
  await vi.waitFor(() => expect(socket().sent).toEqual([{ type: "ack", frame: 7 }]));
});

describe("a connection that is lost", () => {
  test("is found again by its token; what the server has not heard of goes then, and revisions never fall", () => {
    greet();
    const accepted = edit(LOOK, SIGMA, 0.3);
    animate();
    const lost = edit(accepted, "/display/exposure", 1);
    socket().onclose({ code: 1006, reason: "" });
    edit(lost, SIGMA, 0.4);
    vi.advanceTimersByTime(10_000);
    expect(FakeSocket.opened).toHaveLength(2);
    socket().onopen();
    expect(socket().opening).toEqual({ type: "open", resume: "token" });
    expect(socket().url.search).toBe("");
    expect(socket().sent).toEqual([]);
    socket().hello(structuredClone(accepted), 1);
    const [again] = socket().edits;
    expect(again?.revision).toBe(3);
    expect(again?.patch).toEqual([
      { op: "replace", path: SIGMA, value: 0.4 },
      { op: "replace", path: "/display/exposure", value: 1 },
    ]);
  });

  test("takes with it what was to be acknowledged: the next one does not know of it", async () => {
    let drawn: () => void = () => undefined;
    handlers.frame.mockReturnValueOnce(new Promise((done) => (drawn = done)));
    socket().hello(LOOK, 0);
    socket().onmessage({ data: frameOf(0) });
    socket().onclose({ code: 1006, reason: "" });
    vi.advanceTimersByTime(10_000);
    socket().hello(LOOK, 0);
    drawn();
    socket().onmessage({ data: frameOf(0) });
    await vi.waitFor(() => expect(socket().sent.length).toBeGreaterThan(0));
    expect(socket().sent).toEqual([{ type: "ack", frame: 7 }]);
  });

  test("is not tried again where the server says that it is of no use", () => {
    socket().hello(LOOK, 0);
    socket().onclose({ code: 4404, reason: "no such bake" });
    vi.advanceTimersByTime(60_000);
    expect(FakeSocket.opened).toHaveLength(1);
    expect(handlers.ended).toHaveBeenCalledWith("no such bake", 4404);
  });

  test("loses its token after some tries that failed", () => {
    socket().hello(LOOK, 0);
    for (let i = 0; i < 4; i++) {
      socket().onclose({ code: 1006, reason: "" });
      vi.advanceTimersByTime(10_000);
    }
    expect(FakeSocket.opened).toHaveLength(5);
    socket().onopen();
    expect(socket().opening).toEqual({ type: "open", resume: null });
  });
});

test("an edit that is refused: the look that was accepted last is known, and the whole look goes next", () => {
  greet();
  edit(LOOK, SIGMA, 99);
  const message = { type: "problem", revision: 1, problem: { detail: "too much" } };
  socket().says(message);
  expect(handlers.problem).toHaveBeenCalledWith(message, LOOK);
  session.setTarget({ look: lookWith(LOOK, SIGMA, 0.3), activeControl: null, solo: null, inputTime: 0 });
  animate();
  expect(socket().edits[1]).toMatchObject({ revision: 2, patch: [{ op: "replace", path: "" }] });
});

test("what is no message is said, and does no harm", () => {
  for (const text of ["{", "null", "[]", '"hello"', "{}"]) socket().onmessage({ data: text });
  socket().onmessage({ data: new ArrayBuffer(2) });
  expect(handlers.invalidMessage).toHaveBeenCalledTimes(6);
  socket().says({ type: "news of a later server" });
  socket().says({ type: "constructor" });
  expect(handlers.invalidMessage).toHaveBeenCalledTimes(6);
});
