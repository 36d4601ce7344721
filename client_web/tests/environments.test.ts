import { describe, expect, it } from "vitest";
import { changeValue } from "../src/state/document/jsonPatch";
import { environmentOf } from "../src/panels/scene/environments";
import { LOOK } from "./exampleLook";

const file = (name: string) => new File([], name);

describe("an environment among dropped files", () => {
  it("is recognized by its name", () => {
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
    const lit = changeValue(LOOK, "/environment/map", "env:0123456789abcdef");
    expect(lit.patch).toEqual([{ op: "replace", path: "/environment/map", value: "env:0123456789abcdef" }]);
    const back = changeValue(lit.after, "/environment/map", null);
    expect(back.patch).toEqual([{ op: "replace", path: "/environment/map", value: null }]);
  });
});
