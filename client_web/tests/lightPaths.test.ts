import { expect, test } from "vitest";
import { pathFilterText } from "../src/state/visibility/pathLabels";

test("a picture says which light it lacks", () => {
  expect(pathFilterText({ show: "all", bounces: 24 })).toBeNull();
  expect(pathFilterText({ show: "first_bounce", bounces: 24 })).toBe("1st bounce only");
  expect(pathFilterText({ show: "all", bounces: 0 })).toBe("Direct light only");
  expect(pathFilterText({ show: "all", bounces: 1 })).toBe("At most 1 bounce");
});
