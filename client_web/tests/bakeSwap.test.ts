import { beforeEach, expect, test, vi } from "vitest";
import { replaceLook } from "../src/edit/edit";
import { connectToBake } from "../src/session/connect";
import { disconnectAll } from "../src/session/connections";
import type { SessionHandlers } from "../src/session/net/session";
import { stage } from "../src/render/renderStage";
import type { HelloMessage, Look } from "../src/protocol";
import { bake } from "../src/state/bakes";
import { storeCamera } from "../src/state/cameras";
import { isOutdated } from "../src/state/fidelity";
import { look } from "../src/state/look";
import { shownViews, activeViewName } from "../src/state/views";
import { onePixel } from "./exampleFrames";
import { LOOK } from "./exampleLook";

/** The sessions that were opened, the newest last. */
const opened = vi.hoisted((): FakeSession[] => {
  vi.stubGlobal("window", { setTimeout: () => 0 });
  return [];
});

interface FakeSession {
  revision: number;
  bake: string;
  handlers: SessionHandlers;
  sent: { type: string }[];
  target: Look | null;
}

vi.mock("../src/session/net/session", () => ({
  Session: class {
    revision = 0;
    hasPendingEdits = false;
    constructor(
      readonly bake: string,
      readonly handlers: SessionHandlers,
    ) {
      opened.push(this);
    }
    connect = () => undefined;
    close = () => undefined;
    target: Look | null = null;
    setTarget = ({ look }: { look: Look }) => void (this.target = look);
    send = (message: { type: string }) => (this.sent.push(message), true);
    sent: { type: string }[] = [];
    sendAfterEdits = () => true;
  },
}));

const VIEWS = ["front", "left"].map((name) => ({ name, width: 1, height: 1, aspect: 1 }));

function greet(bake: string): FakeSession {
  connectToBake(bake);
  const session = opened.at(-1) as FakeSession;
  const hello = {
    type: "hello",
    views: VIEWS,
    view: "front",
    method: "direct",
    look: LOOK,
    revision: 0,
    resume: "",
    room: null,
  };
  session.handlers.hello(hello as unknown as HelloMessage);
  return session;
}

const frame = (view: string, complete = true) => onePixel(view, complete);

/** Both views of an old bake are shown, the first has the focus; a new bake has said hello. */
async function newBake(): Promise<FakeSession> {
  const old = greet("old");
  for (const view of shownViews.value) await old.handlers.frame(frame(view));
  for (const view of shownViews.value) stage.imageOf(view).idsOf = "new"; // none are fetched
  return greet("new");
}

beforeEach(() => {
  disconnectAll();
  stage.clear();
  for (const { name } of VIEWS) stage.imageOf(name).idsOf = "old";
  look.value = LOOK;
  shownViews.value = ["front", "left"];
  activeViewName.value = "front";
});

test("a new bake is shown from the placed camera", async () => {
  const camera = { to_world: [1], yfov: 0.5, near: 0 };
  storeCamera("front", { camera, size: [8, 6] });
  VIEWS[0] = { ...VIEWS[0], camera_mode: "free" } as never;
  const session = await newBake();
  const cameraMessages = session.sent.filter(({ type }) => type === "camera");
  expect(cameraMessages).toMatchObject([{ view: "front", ...camera, size: [8, 6], refine: "exact" }]);
  storeCamera("front", null);
});

test("a new bake replaces the old one when the active view is complete", async () => {
  const session = await newBake();
  await session.handlers.frame(frame("left"));
  await session.handlers.frame(frame("front", false));
  expect(bake.value).toBe("old");
  await session.handlers.frame(frame("front"));
  expect(bake.value).toBe("new");
});

test("a new bake replaces the old one when a complete view becomes active", async () => {
  const session = await newBake();
  await session.handlers.frame(frame("left"));
  activeViewName.value = "left";
  expect(bake.value).toBe("new");
});

test("a new bake replaces the old one when a complete view is shown alone", async () => {
  const session = await newBake();
  activeViewName.value = "left";
  await session.handlers.frame(frame("left", false));
  await session.handlers.frame(frame("front"));
  expect(bake.value).toBe("old");
  shownViews.value = ["front"];
  activeViewName.value = "front";
  expect(bake.value).toBe("new");
});

test("a link's look is applied with the first look of a new user", () => {
  look.value = null;
  const brought = { ...LOOK, display: { ...LOOK.display, exposure: 1 } };
  const stop = look.subscribe((first) => first?.display.exposure === 0 && replaceLook("Shared look", brought));
  const session = greet("first");
  stop();
  expect(session.target).toEqual(brought);
});

test("the image is outdated from an edit until every shown view has a newer one", async () => {
  const session = greet("old");
  for (const view of shownViews.value) await session.handlers.frame(frame(view));
  expect(isOutdated.value).toBe(false);
  session.revision = 1;
  session.handlers.onEditSent(1, 0);
  expect(isOutdated.value).toBe(true);
  for (const view of ["front", "left"]) {
    expect(isOutdated.value).toBe(true);
    const answer = frame(view);
    await session.handlers.frame({ ...answer, header: { ...answer.header, revision: 1 } });
  }
  expect(isOutdated.value).toBe(false);
});
