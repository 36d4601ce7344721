/** Zoom of the active view, as buttons and keys know it. */
import { stage } from "./stage";
import { FIT, shownWidth, zoomAt, type Canvas } from "./transform";
import { moveTo, transformOf } from "./viewTransforms";

const NOWHERE: Canvas = { width: 1, height: 1, aspect: 1, margin: 0 };

/** The canvas of the view that keys mean. */
const canvas = () => stage.active.screen?.size() ?? NOWHERE;

export function zoomBy(factor: number): void {
  const { view } = stage.active;
  const size = canvas();
  moveTo(view, zoomAt(transformOf(view), size, factor, size.width / 2, size.height / 2));
}

export function zoomFit(): void {
  moveTo(stage.active.view, FIT);
}

/** Screen pixels per picture pixel. */
export function zoomFactor(): number {
  const { view, pixels } = stage.active;
  return (shownWidth(transformOf(view), canvas()) * (window.devicePixelRatio || 1)) / pixels.width;
}

/** One pixel of the picture on one pixel of the screen. */
export function zoomActual(): void {
  zoomBy(1 / zoomFactor());
}
