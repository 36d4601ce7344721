/** Finds the image pixel and the material under the pointer. */
import type { ImageCanvas } from "./canvas";
import { toImagePoint } from "./zoomTransform";
import { transformOf } from "./viewTransforms";

export interface PixelHit {
  /** Position in the canvas, CSS pixels. */
  x: number;
  y: number;
  /** Position in the image, image pixels; may lie outside. */
  px: number;
  py: number;
  material: string | null;
}

export function pickMaterial(screen: ImageCanvas, event: MouseEvent): PixelHit {
  const box = screen.canvas.getBoundingClientRect();
  const { image } = screen;
  const [x, y] = [event.clientX - box.left, event.clientY - box.top];
  const [u, v] = toImagePoint(transformOf(image.view), screen.size(), x, y);
  const [px, py] = [Math.floor(u * image.pixels.width), Math.floor(v * image.pixels.height)];
  return { x, y, px, py, material: image.material(px, py) };
}
