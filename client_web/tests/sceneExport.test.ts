import { expect, test } from "vitest";
import { fileName, reportLines } from "../src/session/scene/sceneExport";

test("fits come first, the largest error first, with the look of a variant", () => {
  const material = { look: null, exact: false, omitted: [] as string[] };
  const report = {
    materials: [
      { ...material, name: "Wall", exact: true, error: 0.001, omitted: ["The BTF of “Wall” is exported as its mean."] },
      { ...material, name: "Tray", error: 0.118 },
      { ...material, name: "Cloth", look: "Night", error: 0.254 },
    ],
    omitted: ["The environment studio is not part of the file."],
  };
  expect(reportLines(report)).toEqual([
    "Cloth in “Night”: fitted, error 25 %",
    "Tray: fitted, error 12 %",
    "The BTF of “Wall” is exported as its mean.",
    "The environment studio is not part of the file.",
  ]);
});

test("file names are read from the header", () => {
  expect(fileName('attachment; filename="a.glb"')).toBe("a.glb");
  expect(fileName("attachment; filename*=utf-8''%E7%81%AF.usdz")).toBe("灯.usdz");
  expect(fileName("")).toBe("scene");
});
