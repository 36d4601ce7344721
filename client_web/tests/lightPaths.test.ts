import { expect, test } from "vitest";
import { pathFilterText } from "../src/state/visibility/pathLabels";

test("a picture says which light it lacks", () => {
  expect(pathFilterText({ show: "all", bounces: 24 })).toBeNull();
  expect(pathFilterText({ show: "first_bounce", bounces: 24 })).toBe("Only the first bounce");
  expect(pathFilterText({ show: "all", bounces: 0 })).toBe("Only direct light");
  expect(pathFilterText({ show: "all", bounces: 1 })).toBe("At most 1 bounce");
});
