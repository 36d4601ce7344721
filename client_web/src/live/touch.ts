/** What is taken hold of before any edit: the server is told, so that it is prepared. */
import { effect } from "@preact/signals";
import { hand } from "../edit/hand";
import { stage } from "../picture/stage";
import { forgetShape } from "../state/curveShape";
import { curvePath } from "../state/selection";
import { send } from "./connections";

/** A hand has come to what moves a parameter, a light or a field of the environment. */
export function hold(parameter: string): void {
  hand.value = parameter;
  send({ type: "touch", parameter });
}

/** The hand has come back to the open curve, which the server may have put away for what it was on meanwhile. */
export function holdCurve(): void {
  const curve = curvePath.peek();
  if (curve !== null && hand.peek() !== curve) touchCurve(curve);
}

function touchCurve(curve: string): void {
  hand.value = curve;
  send({ type: "touch", curve });
}

effect(() => {
  const curve = curvePath.value;
  forgetShape();
  stage.clearBrush();
  if (curve !== null) touchCurve(curve);
});
