import { describe, expect, test } from "vitest";
import type { Frame } from "../src/session/net/binaryFrame";
import { PendingFrames } from "../src/render/frameArrival";
import { worstFidelity } from "../src/state/fidelity";
import { onePixel } from "./exampleFrames";

const frame = (view: string, complete: boolean, at: number, width = 4): Frame => onePixel(view, complete, at, width);

describe("a view's first picture", () => {
  test("is kept aside until it is whole, with all that came for it", () => {
    const arrivals = new PendingFrames();
    expect(arrivals.addFrame(frame("front", false, 1)).isComplete).toBe(false);
    arrivals.addFrame(frame("left", true, 3));
    const whole = arrivals.addFrame(frame("front", true, 2));
    expect(whole.isComplete).toBe(true);
    expect([...(whole.pixels?.encoded ?? [])]).toEqual([0, 1, 2, 0]);
    expect(arrivals.isDisplayed("front")).toBe(false);
    arrivals.markDisplayed("front");
    expect(arrivals.isDisplayed("front")).toBe(true);
    expect(arrivals.get("left")?.isComplete).toBe(true);
  });

  test("keeps how much it covers", () => {
    const [tilePart, rest] = [frame("front", false, 1), frame("front", true, 2)];
    const clear = (source: Frame): Frame => ({
      ...source,
      header: { ...source.header, alpha: true },
      alpha: new Uint8Array([7]),
    });
    const arrivals = new PendingFrames();
    arrivals.addFrame(clear(tilePart));
    expect([...(arrivals.addFrame(clear(rest)).alpha ?? [])]).toEqual([255, 7, 7, 255]);
    expect(arrivals.addFrame(frame("front", true, 3)).alpha).toBeNull();
  });

  test("is the image that the server has tone-mapped, unless tiles have come since", () => {
    const arrivals = new PendingFrames();
    const tiles = frame("front", true, 2);
    const jpeg: Frame = {
      header: { ...tiles.header, format: "jpeg", revision: 3 },
      payload: new Uint8Array(9),
      alpha: null,
    };
    expect(arrivals.addFrame(jpeg)).toMatchObject({ isComplete: true, jpeg, pixels: null });
    expect(arrivals.addFrame(tiles)).toMatchObject({ jpeg: null, header: { revision: 2 } });
  });

  test("begins anew in another size, and when the server has forgotten the view", () => {
    const arrivals = new PendingFrames();
    arrivals.addFrame(frame("front", false, 1));
    expect(arrivals.addFrame(frame("front", true, 2, 5)).pixels?.encoded).toHaveLength(5);
    arrivals.markDisplayed("front");
    arrivals.addFrame(frame("left", false, 1));
    arrivals.retain(["top"]);
    expect(arrivals.isDisplayed("front")).toBe(false);
    expect(arrivals.get("left")).toBeUndefined();
  });
});

test("several pictures are as true as the worst of them", () => {
  expect(worstFidelity(["exact", "near_exact", "incremental"])).toBe("incremental");
  expect(worstFidelity(["approximate", "preview"])).toBe("preview");
  expect(worstFidelity([])).toBe("exact");
});
