/** Announces upcoming edits to the server, so that it can prepare. */
import { effect } from "@preact/signals";
import { activeControl } from "../edit/activeControl";
import { stage } from "../render/renderStage";
import { clearCurvePreview } from "../state/curvePreview";
import { curvePath } from "../state/selection";
import { sendToShown } from "./connections";

/** The pointer has entered the control of a parameter, a light or an environment field. */
export function beginDrag(parameter: string): void {
  activeControl.value = parameter;
  sendToShown({ type: "prepare", parameter });
}

/** The pointer has returned to the open curve, whose operator the server may have evicted. */
export function beginCurveDrag(): void {
  const curve = curvePath.peek();
  if (curve !== null && activeControl.peek() !== curve) prepareCurve(curve);
}

function prepareCurve(curve: string): void {
  activeControl.value = curve;
  sendToShown({ type: "prepare", curve });
}

effect(() => {
  const curve = curvePath.value;
  clearCurvePreview();
  stage.clearBrush();
  // after the edit that has brought the curve, which is sent when the look has changed
  if (curve !== null) queueMicrotask(() => curve === curvePath.peek() && prepareCurve(curve));
});
