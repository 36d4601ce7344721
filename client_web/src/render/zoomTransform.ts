/** The image's position on the canvas. Image positions are fractions of its sides, so that a finer bake of the same view
 * covers the same area. Screen lengths are CSS pixels. */

export interface ZoomTransform {
  /** Width of the whole image on the screen; null fits it into the canvas. */
  width: number | null;
  /** The point of the image at the middle of the canvas. */
  center: [u: number, v: number];
}
export interface CanvasGeometry {
  width: number;
  height: number;
  /** Width ÷ height of the image. */
  aspect: number;
  /** Margin around a fitted image. */
  margin: number;
}

export const FIT: ZoomTransform = { width: null, center: [0.5, 0.5] };
export const MARGIN_ALONE = 16;
export const MARGIN_GRID = 5;
const MIN_WIDTH = 48;
const MAX_WIDTH = 65_536;

export function fitWidth(canvas: CanvasGeometry): number {
  const width = Math.max(1, canvas.width - 2 * canvas.margin);
  const height = Math.max(1, canvas.height - 2 * canvas.margin);
  return Math.min(width, height * canvas.aspect);
}

export function displayedWidth(transform: ZoomTransform, canvas: CanvasGeometry): number {
  return transform.width ?? fitWidth(canvas);
}

/** The image position under a canvas point; outside [0, 1] beside the image. */
export function toImagePoint(
  transform: ZoomTransform,
  canvas: CanvasGeometry,
  x: number,
  y: number,
): [u: number, v: number] {
  const width = displayedWidth(transform, canvas);
  const [cu, cv] = transform.center;
  return [cu + (x - canvas.width / 2) / width, cv + ((y - canvas.height / 2) * canvas.aspect) / width];
}

export function toScreenPoint(
  transform: ZoomTransform,
  canvas: CanvasGeometry,
  u: number,
  v: number,
): [x: number, y: number] {
  const width = displayedWidth(transform, canvas);
  const [cu, cv] = transform.center;
  return [canvas.width / 2 + (u - cu) * width, canvas.height / 2 + ((v - cv) * width) / canvas.aspect];
}

/** The visible pixels of an image: x, y, width, height; null if all or none are visible. */
export function visibleRegion(
  transform: ZoomTransform,
  canvas: CanvasGeometry,
  width: number,
  height: number,
): [x: number, y: number, width: number, height: number] | null {
  const [left, top] = toImagePoint(transform, canvas, 0, 0);
  const [right, bottom] = toImagePoint(transform, canvas, canvas.width, canvas.height);
  const [x, y] = [Math.max(0, Math.floor(left * width)), Math.max(0, Math.floor(top * height))];
  const [across, down] = [
    Math.min(width, Math.ceil(right * width)) - x,
    Math.min(height, Math.ceil(bottom * height)) - y,
  ];
  const isAll = across === width && down === height;
  return isAll || across < 1 || down < 1 ? null : [x, y, across, down];
}

/** Zoom by `factor` around the canvas point (x, y). */
export function zoomAt(
  transform: ZoomTransform,
  canvas: CanvasGeometry,
  factor: number,
  x: number,
  y: number,
): ZoomTransform {
  const previousWidth = displayedWidth(transform, canvas);
  const width = Math.min(MAX_WIDTH, Math.max(MIN_WIDTH, previousWidth * factor));
  const [u, v] = toImagePoint(transform, canvas, x, y);
  return clampTransform({
    width,
    center: [u - (x - canvas.width / 2) / width, v - ((y - canvas.height / 2) * canvas.aspect) / width],
  });
}

export function panTransform(transform: ZoomTransform, canvas: CanvasGeometry, dx: number, dy: number): ZoomTransform {
  const width = displayedWidth(transform, canvas);
  const [u, v] = transform.center;
  return clampTransform({ width, center: [u - dx / width, v - (dy * canvas.aspect) / width] });
}

/** Keeps the image's center reachable: it cannot leave the canvas. */
function clampTransform(transform: ZoomTransform): ZoomTransform {
  const [u, v] = transform.center;
  return { ...transform, center: [Math.min(1, Math.max(0, u)), Math.min(1, Math.max(0, v))] };
}
