import { describe, expect, test } from "vitest";
import { leaving } from "../src/app/rowRoom";
import { fittingPanels, inspectorWidthIn } from "../src/state/room";

describe("a row that is too narrow", () => {
  const parts = [
    { name: "views", width: 100, rank: 2 },
    { name: "none", width: 0, rank: 0 },
    { name: "steps", width: 50, rank: 3 },
    { name: "export", width: 80, rank: 1 },
  ];

  test("keeps all that there is room for, without a button for more", () => {
    expect(leaving(parts, 250, 10, 30)).toEqual([]);
  });

  test("puts the least important into the menu first, and has room for its button", () => {
    expect(leaving(parts, 249, 10, 30)).toEqual(["export"]);
    expect(leaving(parts, 200, 10, 30)).toEqual(["export"]);
    expect(leaving(parts, 199, 10, 30)).toEqual(["views", "export"]);
    expect(leaving(parts, 20, 10, 30)).toEqual(["steps", "views", "export"]);
  });
});

describe("panels beside the picture", () => {
  const widths = { outline: 240, library: 280, inspector: 325 };

  test("stay as long as there is room, the newest always", () => {
    expect(fittingPanels(["library", "inspector", "outline"], widths, 845)).toEqual(["library", "inspector", "outline"]);
    expect(fittingPanels(["library", "inspector", "outline"], widths, 844)).toEqual(["library", "inspector"]);
    expect(fittingPanels(["outline", "inspector"], widths, 400)).toEqual(["outline"]);
    expect(fittingPanels(["inspector"], widths, 10)).toEqual(["inspector"]);
  });

  test("the inspector leaves the picture nearly half of a narrow window", () => {
    expect(inspectorWidthIn(1280, 320)).toBe(320);
    expect(inspectorWidthIn(900, 700)).toBe(495);
    expect(inspectorWidthIn(400, 700)).toBe(288);
    expect(inspectorWidthIn(4000, 3000)).toBe(720);
  });
});
