/** The latency from input to image counts no time without a connection. */
import { expect, test, vi } from "vitest";
import { recordEditSent, clearPendingEdits, recordFrameShown, latencyMs } from "../src/state/latency";

test("an edit that waited for a connection counts from when there was one", () => {
  const now = vi.spyOn(performance, "now").mockReturnValue(1000);
  recordEditSent(1, 1000);
  now.mockReturnValue(60_000);
  clearPendingEdits(); // the server answers again
  recordFrameShown(1);
  expect(latencyMs.value).toBeNull();
  recordEditSent(2, 2000); // it was made while nobody answered
  now.mockReturnValue(60_040);
  recordFrameShown(2);
  expect(latencyMs.value).toBe(40);
  now.mockRestore();
});
