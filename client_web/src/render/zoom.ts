/** Zoom of the active view, for buttons and keys. */
import { stage } from "./renderStage";
import { FIT, displayedWidth, zoomAt, type CanvasGeometry } from "./zoomTransform";
import { setTransform, transformOf } from "./viewTransforms";

const EMPTY_CANVAS: CanvasGeometry = { width: 1, height: 1, aspect: 1, margin: 0 };

/** The canvas of the active view. */
const canvasGeometry = () => stage.active.screen?.size() ?? EMPTY_CANVAS;

export function zoomBy(factor: number): void {
  const { view } = stage.active;
  const size = canvasGeometry();
  setTransform(view, zoomAt(transformOf(view), size, factor, size.width / 2, size.height / 2));
}

export function zoomFit(): void {
  setTransform(stage.active.view, FIT);
}

/** Screen pixels per image pixel. */
export function zoomFactor(): number {
  const { view, pixels } = stage.active;
  return (displayedWidth(transformOf(view), canvasGeometry()) * (window.devicePixelRatio || 1)) / pixels.width;
}

/** Zoom to one screen pixel per image pixel. */
export function zoomActual(): void {
  zoomBy(1 / zoomFactor());
}
