import { expect, test } from "vitest";
import { limitWords } from "../src/seen/pathWords";

test("a picture says which light it lacks", () => {
  expect(limitWords({ show: "all", bounces: 24 })).toBeNull();
  expect(limitWords({ show: "first_bounce", bounces: 24 })).toBe("Only the first bounce");
  expect(limitWords({ show: "all", bounces: 0 })).toBe("Only direct light");
  expect(limitWords({ show: "all", bounces: 1 })).toBe("At most 1 bounce");
});
