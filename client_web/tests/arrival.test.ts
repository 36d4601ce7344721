import { describe, expect, test } from "vitest";
import type { Frame } from "../src/net/binaryFrame";
import { Arrivals } from "../src/picture/arrival";
import { worst } from "../src/state/fidelity";
import { onePixel } from "./frames";

const frame = (view: string, complete: boolean, at: number, width = 4): Frame => onePixel(view, complete, at, width);

describe("a view's first picture", () => {
  test("is kept aside until it is whole, with all that came for it", () => {
    const arrivals = new Arrivals();
    expect(arrivals.take(frame("front", false, 1)).isWhole).toBe(false);
    arrivals.take(frame("left", true, 3));
    const whole = arrivals.take(frame("front", true, 2));
    expect(whole.isWhole).toBe(true);
    expect([...(whole.pixels?.words ?? [])]).toEqual([0, 1, 2, 0]);
    expect(arrivals.isShown("front")).toBe(false);
    arrivals.show("front");
    expect(arrivals.isShown("front")).toBe(true);
    expect(arrivals.get("left")?.isWhole).toBe(true);
  });

  test("keeps how much it covers", () => {
    const [part, rest] = [frame("front", false, 1), frame("front", true, 2)];
    const clear = (of: Frame): Frame => ({ ...of, header: { ...of.header, alpha: true }, alpha: new Uint8Array([7]) });
    const arrivals = new Arrivals();
    arrivals.take(clear(part));
    expect([...(arrivals.take(clear(rest)).alpha ?? [])]).toEqual([255, 7, 7, 255]);
    expect(arrivals.take(frame("front", true, 3)).alpha).toBeNull();
  });

  test("is the image that the server has tone-mapped, unless tiles have come since", () => {
    const arrivals = new Arrivals();
    const tiles = frame("front", true, 2);
    const jpeg: Frame = { header: { ...tiles.header, format: "jpeg", revision: 3 }, payload: new Uint8Array(9), alpha: null };
    expect(arrivals.take(jpeg)).toMatchObject({ isWhole: true, jpeg, pixels: null });
    expect(arrivals.take(tiles)).toMatchObject({ jpeg: null, header: { revision: 2 } });
  });

  test("begins anew in another size, and when the server has forgotten the view", () => {
    const arrivals = new Arrivals();
    arrivals.take(frame("front", false, 1));
    expect(arrivals.take(frame("front", true, 2, 5)).pixels?.words).toHaveLength(5);
    arrivals.show("front");
    arrivals.take(frame("left", false, 1));
    arrivals.keep(["top"]);
    expect(arrivals.isShown("front")).toBe(false);
    expect(arrivals.get("left")).toBeUndefined();
  });
});

test("several pictures are as true as the worst of them", () => {
  expect(worst(["exact", "near", "followed"])).toBe("followed");
  expect(worst(["approximate", "preview"])).toBe("preview");
  expect(worst([])).toBe("exact");
});
