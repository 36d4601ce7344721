import { describe, expect, it } from "vitest";
import { environmentOf } from "../src/outline/environments";
import { diffLooks } from "../src/state/diff";
import { setAt } from "../src/state/pointer";
import { LOOK } from "./look";

const file = (name: string) => new File([], name);

describe("an environment among dropped files", () => {
  it("is told by its name", () => {
    expect(environmentOf([file("notes.txt"), file("Sunset.HDR")])?.name).toBe("Sunset.HDR");
    expect(environmentOf([file("sky.exr"), file("other.hdr")])?.name).toBe("sky.exr");
  });

  it("is not any other file", () => {
    expect(environmentOf([file("teapot.glb"), file("hdr.zip")])).toBeNull();
    expect(environmentOf([])).toBeNull();
  });
});

describe("another environment", () => {
  it("travels as one operation, also where the look knew none", () => {
    const lit = setAt(LOOK, "/environment/map", "env:0123456789abcdef");
    expect(diffLooks(LOOK, lit)).toEqual([{ op: "add", path: "/environment/map", value: "env:0123456789abcdef" }]);
    const back = setAt(lit, "/environment/map", null);
    expect(diffLooks(lit, back)).toEqual([{ op: "replace", path: "/environment/map", value: null }]);
  });
});
