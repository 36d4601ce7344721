/** Errors disappear when they are resolved. */
import { beforeEach, expect, test, vi } from "vitest";
import { ApiError, UnreachableError } from "../src/session/net/api";
import { reportErrors, clearErrors, visibleTexts, showError, showNote, showWarnings } from "../src/ui/toasts";

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

test("notes do not remove errors, and all warnings of a file are one note", () => {
  vi.stubGlobal("window", { setTimeout: () => 0 });
  showError("refused", "edit");
  showWarnings(["Texels that are not numbers are black.", "Negative texels are black."]);
  for (const text of ["one", "two"]) showNote(text);
  const warnings = "Texels that are not numbers are black. Negative texels are black.";
  expect(visibleTexts()).toEqual(["refused", warnings, "one", "two"]);
  showNote("three");
  expect(visibleTexts()).toEqual(["refused", "one", "two", "three"]);
  vi.unstubAllGlobals();
});
