import { describe, expect, test } from "vitest";
import { overflowingItems } from "../src/app/rowFit";
import { fittingPanels, clampInspectorWidth } from "../src/state/panelWidths";

describe("a row that is too narrow", () => {
  const items = [
    { name: "views", width: 100, rank: 2 },
    { name: "none", width: 0, rank: 0 },
    { name: "steps", width: 50, rank: 3 },
    { name: "export", width: 80, rank: 1 },
  ];

  test("keeps all that there is room for, without a button for more", () => {
    expect(overflowingItems(items, 250, 10, 30)).toEqual([]);
  });

  test("puts the least important into the menu first, and has room for its button", () => {
    expect(overflowingItems(items, 249, 10, 30)).toEqual(["export"]);
    expect(overflowingItems(items, 200, 10, 30)).toEqual(["export"]);
    expect(overflowingItems(items, 199, 10, 30)).toEqual(["views", "export"]);
    expect(overflowingItems(items, 20, 10, 30)).toEqual(["steps", "views", "export"]);
  });
});

describe("panels beside the picture", () => {
  const widths = { outline: 240, library: 280, inspector: 325 };

  test("stay as long as there is room, the newest always", () => {
    expect(fittingPanels(["library", "inspector", "outline"], widths, 845)).toEqual([
      "library",
      "inspector",
      "outline",
    ]);
    expect(fittingPanels(["library", "inspector", "outline"], widths, 844)).toEqual(["library", "inspector"]);
    expect(fittingPanels(["outline", "inspector"], widths, 400)).toEqual(["outline"]);
    expect(fittingPanels(["inspector"], widths, 10)).toEqual(["inspector"]);
  });

  test("the inspector leaves the picture nearly half of a narrow window", () => {
    expect(clampInspectorWidth(1280, 320)).toBe(320);
    expect(clampInspectorWidth(900, 700)).toBe(495);
    expect(clampInspectorWidth(400, 700)).toBe(288);
    expect(clampInspectorWidth(4000, 3000)).toBe(720);
  });
});
