/** Pointing at a curve: of a view with a free camera nothing is asked before that has come to rest. */
import { expect, test, vi } from "vitest";

const send = vi.hoisted(() => vi.fn());
vi.hoisted(() => vi.stubGlobal("window", { setTimeout: (run: () => void, ms: number) => setTimeout(run, ms) }));
vi.mock("../src/session/connections", () => ({ sendToShown: send, connections: { shown: null, incoming: null } }));
vi.mock("../src/render/renderStage", () => ({ stage: { clearBrush: () => undefined } }));
vi.mock("../src/state/selection", () => ({ curvePath: { peek: () => "/materials/A/terms/0/curves/theta_h" } }));
vi.mock("../src/state/views", () => ({ hasFreeCamera: { peek: () => true } }));

test("an interval is requested when the camera stops, unless the pointer has left", async () => {
  vi.useFakeTimers();
  const [{ requestBrush, clearBrush }, { fidelity }] = [
    await import("../src/curve/curveBrush"),
    await import("../src/state/fidelity"),
  ];
  fidelity.value = "approximate";
  for (let k = 0; k < 2; k += 1) {
    requestBrush(3, 7);
    vi.advanceTimersByTime(5000);
    expect(send).not.toHaveBeenCalled();
    clearBrush();
  }
  requestBrush(3, 7);
  fidelity.value = "exact";
  vi.advanceTimersByTime(1000);
  expect(send.mock.calls).toEqual([
    [{ type: "highlight_curve_range", curve: "/materials/A/terms/0/curves/theta_h", from: 3, to: 7 }],
  ]);
});

test("an interval is requested when its curve's operator is precomputed", async () => {
  const [{ requestBrush, clearBrush }, { fidelity }] = [
    await import("../src/curve/curveBrush"),
    await import("../src/state/fidelity"),
  ];
  const { freezeStatus } = await import("../src/state/connection");
  send.mockClear();
  fidelity.value = "exact";
  freezeStatus.value = { state: "precomputing", view: "front", label: "A, half angle", progress: 0.2 };
  requestBrush(3, 7);
  vi.advanceTimersByTime(5000);
  expect(send).not.toHaveBeenCalled();
  freezeStatus.value = null;
  vi.advanceTimersByTime(1000);
  expect(send).toHaveBeenCalledOnce();
  clearBrush();
});
