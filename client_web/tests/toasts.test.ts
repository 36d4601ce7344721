/** Errors go when what they say is mended. */
import { beforeEach, expect, test } from "vitest";
import { ApiError, UnansweredError } from "../src/net/api";
import { attempt, mended, shownWords, showError } from "../src/ui/toasts";

beforeEach(() => {
  for (const topic of ["server", "files", "edit"] as const) mended(topic);
});

test("an error goes with the next success in its topic, and others stay", () => {
  showError("no such format", "files");
  showError("refused", "edit");
  mended("files");
  expect(shownWords()).toEqual(["refused"]);
  mended("edit");
  expect(shownWords()).toEqual([]);
});

test("a request that nobody answered is mended by one that somebody does", async () => {
  await attempt(() => Promise.reject(new UnansweredError()));
  await attempt(() => Promise.reject(new ApiError("There is no such scene.", 404)), "files");
  expect(shownWords()).toEqual([new UnansweredError().message, "There is no such scene."]);
  await attempt(() => Promise.resolve());
  expect(shownWords()).toEqual(["There is no such scene."]);
  await attempt(() => Promise.resolve(), "files");
  expect(shownWords()).toEqual([]);
});
