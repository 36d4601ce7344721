import { describe, expect, it } from "vitest";
import { changeAt } from "../src/document/change";
import { environmentOf } from "../src/outline/environments";
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
  it("travels as one operation", () => {
    const lit = changeAt(LOOK, "/environment/map", "env:0123456789abcdef");
    expect(lit.patch).toEqual([{ op: "replace", path: "/environment/map", value: "env:0123456789abcdef" }]);
    const back = changeAt(lit.after, "/environment/map", null);
    expect(back.patch).toEqual([{ op: "replace", path: "/environment/map", value: null }]);
  });
});
