/** Zoom as buttons and keys know it. */
import { transform } from "../state/store";
import { stage } from "./stage";
import { FIT, shownWidth, zoomAt } from "./transform";

export function zoomBy(factor: number): void {
  const canvas = stage.canvasSize();
  transform.value = zoomAt(transform.peek(), canvas, factor, canvas.width / 2, canvas.height / 2);
}

export function zoomFit(): void {
  transform.value = FIT;
}

/** One pixel of the picture on one pixel of the screen. */
export function zoomActual(): void {
  const width = stage.size[0] / (window.devicePixelRatio || 1);
  zoomBy(width / shownWidth(transform.peek(), stage.canvasSize()));
}

/** Screen pixels per picture pixel. */
export function zoomFactor(): number {
  const width = shownWidth(transform.value, stage.canvasSize());
  return (width * (window.devicePixelRatio || 1)) / stage.size[0];
}
