/** Curve → pixels: pointing at an interval requests the pixels that it lights. */
import { sendToShown } from "../session/connections";
import { stage } from "../render/renderStage";
import { freezeStatus } from "../state/connection";
import { brushedRange } from "../state/curvePreview";
import { fidelity } from "../state/fidelity";
import { curvePath } from "../state/selection";
import { hasFreeCamera } from "../state/views";
import { isIntervalLit } from "./curveView";

const DWELL_MS = 120;
const EVERY_MS = 50;
const RETRY_MS = 300;
let timer = 0;
let last = 0;

export function clearBrush(): void {
  clearTimeout(timer);
  timer = 0;
  if (brushedRange.peek() !== null) stage.clearBrush();
}

/** True while the image is interpolated from surface probes, which have no precomputed curves. */
const isPointBrush = () => hasFreeCamera.peek() && (fidelity.peek() === "approximate" || fidelity.peek() === "preview");

/** True while the operator of the open curve is being precomputed. */
const isPending = () => freezeStatus.peek()?.state === "precomputing" || isPointBrush();

/** Request the pixels of an interval: first when the pointer stops, then at most every `EVERY_MS`. Waits until the curve
 * is precomputed, and in a free-camera view until the camera has stopped. */
export function requestBrush(from: number, to: number): void {
  const curve = curvePath.peek();
  if (!isIntervalLit.peek() || curve === null) return;
  clearTimeout(timer);
  const wait = brushedRange.peek() === null ? DWELL_MS : Math.max(0, last + EVERY_MS - performance.now());
  const request = () => {
    if (isPending()) {
      timer = window.setTimeout(request, RETRY_MS);
      return;
    }
    last = performance.now();
    brushedRange.value = [from, to];
    sendToShown({ type: "highlight_curve_range", curve, from: Math.max(0, from), to: Math.min(90, to) });
  };
  timer = window.setTimeout(request, wait);
}
