/** What lies under the pointer. */
import type { Screen } from "./screen";
import { toPicture } from "./transform";
import { transformOf } from "./viewTransforms";

export interface Hit {
  /** In the canvas, CSS pixels. */
  x: number;
  y: number;
  /** In the picture, its own pixels; may lie outside. */
  px: number;
  py: number;
  material: string | null;
}

export function hitAt(screen: Screen, event: MouseEvent): Hit {
  const box = screen.canvas.getBoundingClientRect();
  const { picture } = screen;
  const [x, y] = [event.clientX - box.left, event.clientY - box.top];
  const [u, v] = toPicture(transformOf(picture.view), screen.size(), x, y);
  const [px, py] = [Math.floor(u * picture.pixels.width), Math.floor(v * picture.pixels.height)];
  return { x, y, px, py, material: picture.material(px, py) };
}
