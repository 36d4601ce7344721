/** What lies under the pointer. */
import type { ImageCanvas } from "./canvas";
import { toImagePoint } from "./zoomTransform";
import { transformOf } from "./viewTransforms";

export interface PixelHit {
  /** In the canvas, CSS pixels. */
  x: number;
  y: number;
  /** In the image, its own pixels; may lie outside. */
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
