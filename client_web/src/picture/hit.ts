/** What lies under the pointer. */
import { transform } from "../state/store";
import { stage } from "./stage";
import { toPicture } from "./transform";

export interface Hit {
  /** In the canvas, CSS pixels. */
  x: number;
  y: number;
  /** In the picture, its own pixels; may lie outside. */
  px: number;
  py: number;
  material: string | null;
}

export function hitAt(canvas: HTMLCanvasElement, event: MouseEvent): Hit {
  const box = canvas.getBoundingClientRect();
  const [x, y] = [event.clientX - box.left, event.clientY - box.top];
  const [u, v] = toPicture(transform.peek(), stage.canvasSize(), x, y);
  const [width, height] = stage.size;
  const [px, py] = [Math.floor(u * width), Math.floor(v * height)];
  return { x, y, px, py, material: stage.material(px, py) };
}
