/** Images of looks that have names, and of steps: of saved looks, of variants of a scene's file, of what was left. */
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { history } from "../src/edit/history";
import { changeToLook } from "../src/state/document/jsonPatch";
import { thumbnailOf, variantThumbnail } from "../src/panels/looks/namedThumbnails";
import { savedLooks } from "../src/panels/looks/savedLooks";
import { trackThumbnails, attachThumbnail } from "../src/panels/looks/thumbnails";
import { defaultLook } from "../src/state/look";
import { scene } from "../src/state/scene";
import { storeThumbnail, lookThumbnail } from "../src/state/thumbnails";
import { LOOK, lookWith } from "./exampleLook";

const screen = vi.hoisted(() => ({ encoded: new Uint32Array([1]) }));
vi.mock("../src/panels/looks/displayImage", () => ({
  renderThumbnail: (pixels: { encoded: Uint32Array }) => `screen ${pixels.encoded[0]}`,
}));
vi.mock("../src/render/renderStage", () => ({
  stage: {
    active: {
      hasPixels: true,
      get pixels() {
        return { width: 1, height: 1, encoded: screen.encoded };
      },
    },
    imageOf: () => ({ revision: 0 }),
    displayed: [],
  },
}));

let sent: string[];

beforeEach(() => {
  sent = [];
  vi.useFakeTimers();
  vi.stubGlobal("window", { setTimeout: (run: () => void, ms?: number) => setTimeout(run, ms) });
  vi.stubGlobal("fetch", (path: string, init: RequestInit) => {
    sent.push(`${init.method} ${path} ${new Headers(init.headers).get("if-match")} ${init.body as string}`);
    return Promise.resolve(new Response(null, { status: 204 }));
  });
});
afterEach(() => vi.useRealTimers());

test("a look gives its picture to what it is the look of, once, and to everybody", async () => {
  const stored = new Map<string, string>();
  vi.stubGlobal("localStorage", {
    getItem: (key: string) => stored.get(key) ?? null,
    setItem: (key: string, text: string) => stored.set(key, text),
  });
  const bright = lookWith(LOOK, "/display/exposure", 2);
  defaultLook.value = LOOK;
  scene.value = {
    id: "s",
    materials: [],
    variants: [
      { name: "Own", look: {} },
      { name: "Bright", look: bright },
    ],
  } as never;
  savedLooks.value = [{ name: "Bright", etag: '"b"', created: "1", view: null, look: bright }];
  attachThumbnail(bright, "data:bright");
  attachThumbnail(bright, "data:another");
  await vi.waitFor(() => expect(sent).toEqual(['PUT ./api/looks/Bright/thumbnail "b" {"picture":"data:bright"}']));
  expect([thumbnailOf('"b"'), variantThumbnail("Bright"), variantThumbnail("Own")]).toEqual([
    "data:bright",
    "data:bright",
    null,
  ]);
  attachThumbnail(LOOK, "data:own");
  expect(variantThumbnail("Own")).toBe("data:own");
});

test("a step that is left without a picture has what the screen showed then, and looks on a drag's way have none", () => {
  history.clear();
  trackThumbnails();
  const looks = [1, 2, 3, 4].map((exposure) => lookWith(LOOK, "/display/exposure", exposure));
  const [first, onTheWay, second, third] = looks as [typeof LOOK, typeof LOOK, typeof LOOK, typeof LOOK];
  const step = (before: typeof LOOK, after: typeof LOOK, key: string) =>
    history.record({ kind: "look", label: key, key, ...changeToLook(before, after) });
  storeThumbnail(LOOK, "as opened");
  step(LOOK, first, "a");
  history.endGesture();
  screen.encoded = new Uint32Array([7]);
  step(first, onTheWay, "b");
  step(onTheWay, second, "b");
  screen.encoded = new Uint32Array([8]); // the image has been drawn on while the thumbnail waits
  vi.runAllTimers();
  expect([LOOK, first, onTheWay, second].map(lookThumbnail)).toEqual(["as opened", "screen 7", null, null]);
  history.endGesture();
  step(second, third, "c");
  vi.runAllTimers();
  expect([second, third].map(lookThumbnail)).toEqual(["screen 8", null]);
});
