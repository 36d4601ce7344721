/** The time from the hand to the picture counts no time without a connection. */
import { expect, test, vi } from "vitest";
import { editSent, forgetWaiting, frameDrawn, latencyMs } from "../src/state/latency";

test("an edit that waited for a connection counts from when there was one", () => {
  const now = vi.spyOn(performance, "now").mockReturnValue(1000);
  editSent(1, 1000);
  now.mockReturnValue(60_000);
  forgetWaiting(); // the server answers again
  frameDrawn(1);
  expect(latencyMs.value).toBeNull();
  editSent(2, 2000); // it was made while nobody answered
  now.mockReturnValue(60_040);
  frameDrawn(2);
  expect(latencyMs.value).toBe(40);
  now.mockRestore();
});
