/** Errors disappear when they are resolved. */
import { beforeEach, expect, test } from "vitest";
import { ApiError, UnreachableError } from "../src/session/net/api";
import { reportErrors, clearErrors, visibleTexts, showError } from "../src/ui/toasts";

beforeEach(() => {
  for (const topic of ["server", "files", "edit"] as const) clearErrors(topic);
});

test("an error goes with the next success in its topic, and others stay", () => {
  showError("no such format", "files");
  showError("refused", "edit");
  clearErrors("files");
  expect(visibleTexts()).toEqual(["refused"]);
  clearErrors("edit");
  expect(visibleTexts()).toEqual([]);
});

test("a successful request resolves the error of an unanswered one", async () => {
  await reportErrors(() => Promise.reject(new UnreachableError()));
  await reportErrors(() => Promise.reject(new ApiError("There is no such scene.", 404)), "files");
  expect(visibleTexts()).toEqual([new UnreachableError().message, "There is no such scene."]);
  await reportErrors(() => Promise.resolve());
  expect(visibleTexts()).toEqual(["There is no such scene."]);
  await reportErrors(() => Promise.resolve(), "files");
  expect(visibleTexts()).toEqual([]);
});
