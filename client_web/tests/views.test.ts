import { describe, expect, test } from "vitest";
import { cameraMessage } from "../src/viewport/cameras/CameraBar";
import { availableViews, shownViews, chooseSideBySide, activeViewName } from "../src/state/views";
import { columnsFor } from "../src/viewport/viewGrid";

describe("views side by side", () => {
  const all = ["a", "b", "c", "d", "e", "f"];

  test("at most four are shown, the active one among them", () => {
    expect(chooseSideBySide(["a", "b"], "b")).toEqual(["a", "b"]);
    expect(chooseSideBySide(all, "c")).toEqual(["a", "b", "c", "d"]);
    expect(chooseSideBySide(all, "f")).toEqual(["a", "b", "c", "f"]);
    expect(chooseSideBySide(all, "gone")).toEqual(["a", "b", "c", "d"]);
  });

  test("what an address or another bake asks for is shown as far as it is there", () => {
    expect(availableViews(["c", "gone", "a"], all, "b")).toEqual(["c", "a"]);
    expect(availableViews(["gone"], all, "b")).toEqual(["b"]);
    expect(availableViews([...all], all, "b")).toHaveLength(4);
  });
});

describe("arrangement", () => {
  test.each([
    ["one", 1, 740, 560, 4 / 3, 1],
    ["two on a wide space", 2, 1380, 840, 4 / 3, 2],
    ["two of the same size either way", 2, 800, 800, 1, 2],
    ["two on a high space", 2, 500, 900, 4 / 3, 1],
    ["two wide ones", 2, 740, 560, 2, 1],
    ["three", 3, 1000, 700, 4 / 3, 2],
    ["three on a band", 3, 1600, 400, 4 / 3, 3],
    ["four", 4, 740, 560, 4 / 3, 2],
    ["four on a band", 4, 2400, 500, 4 / 3, 4],
  ])("%s", (_, count, width, height, aspect, columns) => {
    expect(columnsFor(count, width, height, aspect)).toBe(columns);
  });
});

test("with several views the camera bar names the active one", () => {
  activeViewName.value = "left";
  shownViews.value = ["left"];
  expect(cameraMessage.value).toBe("Camera");
  shownViews.value = ["front", "left"];
  expect(cameraMessage.value).toBe("Camera of left");
});
