/** Where the picture lies on the canvas. Positions in the picture are fractions of its sides, so that a finer bake of
 * the same view takes the same place. Screen lengths are CSS pixels. */

export interface Transform {
  /** Width of the whole picture on the screen; null fits it into the canvas. */
  width: number | null;
  /** The point of the picture at the middle of the canvas. */
  centre: [u: number, v: number];
}
export interface Canvas {
  width: number;
  height: number;
  /** Width ÷ height of the picture. */
  aspect: number;
  /** Left free around a fitted picture. */
  margin: number;
}

export const FIT: Transform = { width: null, centre: [0.5, 0.5] };
export const MARGIN_ALONE = 16;
export const MARGIN_BESIDE = 5;
const MIN_WIDTH = 48;
const MAX_WIDTH = 65_536;

export function fitWidth(canvas: Canvas): number {
  const width = Math.max(1, canvas.width - 2 * canvas.margin);
  const height = Math.max(1, canvas.height - 2 * canvas.margin);
  return Math.min(width, height * canvas.aspect);
}

export function shownWidth(transform: Transform, canvas: Canvas): number {
  return transform.width ?? fitWidth(canvas);
}

/** Fractions of the picture under a point of the canvas; outside [0, 1] beside the picture. */
export function toPicture(transform: Transform, canvas: Canvas, x: number, y: number): [u: number, v: number] {
  const width = shownWidth(transform, canvas);
  const [cu, cv] = transform.centre;
  return [cu + (x - canvas.width / 2) / width, cv + ((y - canvas.height / 2) * canvas.aspect) / width];
}

export function toScreen(transform: Transform, canvas: Canvas, u: number, v: number): [x: number, y: number] {
  const width = shownWidth(transform, canvas);
  const [cu, cv] = transform.centre;
  return [canvas.width / 2 + (u - cu) * width, canvas.height / 2 + ((v - cv) * width) / canvas.aspect];
}

/** The pixels of a picture that are on the canvas: x, y, width, height; null where that is all of them, or none. */
export function regionOf(
  transform: Transform,
  canvas: Canvas,
  width: number,
  height: number,
): [x: number, y: number, width: number, height: number] | null {
  const [left, top] = toPicture(transform, canvas, 0, 0);
  const [right, bottom] = toPicture(transform, canvas, canvas.width, canvas.height);
  const [x, y] = [Math.max(0, Math.floor(left * width)), Math.max(0, Math.floor(top * height))];
  const [across, down] = [Math.min(width, Math.ceil(right * width)) - x, Math.min(height, Math.ceil(bottom * height)) - y];
  const isAll = across === width && down === height;
  return isAll || across < 1 || down < 1 ? null : [x, y, across, down];
}

/** Zoom by `factor`, keeping what is under (x, y) where it is. */
export function zoomAt(transform: Transform, canvas: Canvas, factor: number, x: number, y: number): Transform {
  const before = shownWidth(transform, canvas);
  const width = Math.min(MAX_WIDTH, Math.max(MIN_WIDTH, before * factor));
  const [u, v] = toPicture(transform, canvas, x, y);
  return keepInside({
    width,
    centre: [u - (x - canvas.width / 2) / width, v - ((y - canvas.height / 2) * canvas.aspect) / width],
  });
}

export function pan(transform: Transform, canvas: Canvas, dx: number, dy: number): Transform {
  const width = shownWidth(transform, canvas);
  const [u, v] = transform.centre;
  return keepInside({ width, centre: [u - dx / width, v - (dy * canvas.aspect) / width] });
}

/** The picture's own middle stays reachable: it cannot be thrown off the canvas. */
function keepInside(transform: Transform): Transform {
  const [u, v] = transform.centre;
  return { ...transform, centre: [Math.min(1, Math.max(0, u)), Math.min(1, Math.max(0, v))] };
}
