/** The rectangle of the area probe. */
import { signal } from "@preact/signals";

/** Pixels of an image: left, top, and width and height of at least one. */
export interface Area {
  x: number;
  y: number;
  width: number;
  height: number;
}

export const isAreaProbeOn = signal(false);
/** In every view at the same pixels; null: not placed yet. */
export const probedArea = signal<Area | null>(null);

/** Largest side; all its pixels are read after each frame. */
export const MAX_AREA_SIDE = 512;

/** The rectangle between two pixels, both included, inside an image; the second one yields to the largest side. */
export function areaBetween([x0, y0]: [number, number], [x1, y1]: [number, number], size: [number, number]): Area {
  const limit = (v: number, n: number) => Math.min(n - 1, Math.max(0, Math.floor(v)));
  const span = (from: number, to: number, n: number): [start: number, length: number] => {
    const start = limit(from, n);
    const offset = limit(to, n) - start;
    const end = start + Math.sign(offset) * Math.min(MAX_AREA_SIDE - 1, Math.abs(offset));
    return [Math.min(start, end), Math.abs(end - start) + 1];
  };
  const [[x, width], [y, height]] = [span(x0, x1, size[0]), span(y0, y1, size[1])];
  return { x, y, width, height };
}

/** A rectangle in the middle of an image. */
export function middleArea([width, height]: [number, number]): Area {
  const [w, h] = [Math.max(1, Math.round(width / 8)), Math.max(1, Math.round(height / 8))];
  return { x: Math.floor((width - w) / 2), y: Math.floor((height - h) / 2), width: w, height: h };
}

/** The rectangle moved or, with `resize`, made larger by pixels, inside an image. */
export function steppedArea(area: Area, dx: number, dy: number, resize: boolean, [w, h]: [number, number]): Area {
  const clamp = (v: number, low: number, high: number) => Math.min(high, Math.max(low, v));
  if (resize)
    return {
      ...area,
      width: clamp(area.width + dx, 1, Math.min(MAX_AREA_SIDE, w - area.x)),
      height: clamp(area.height + dy, 1, Math.min(MAX_AREA_SIDE, h - area.y)),
    };
  return { ...area, x: clamp(area.x + dx, 0, w - area.width), y: clamp(area.y + dy, 0, h - area.height) };
}
