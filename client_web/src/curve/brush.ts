/** Curve → pixels: pointing at a stretch asks the server which pixels it lights. */
import { send } from "../live/connections";
import { stage } from "../picture/stage";
import { brushed } from "../state/curveShape";
import { curvePath } from "../state/selection";
import { lights } from "./settings";

const DWELL_MS = 120;
const EVERY_MS = 50;
let timer = 0;
let last = 0;

export function clearBrush(): void {
  clearTimeout(timer);
  timer = 0;
  if (brushed.peek() !== null) stage.clearBrush();
}

/** Ask for the pixels of a stretch; at first only when the pointer rests, then at most every `EVERY_MS`. */
export function brush(from: number, to: number): void {
  const curve = curvePath.peek();
  if (!lights.peek() || curve === null) return;
  clearTimeout(timer);
  const wait = brushed.peek() === null ? DWELL_MS : Math.max(0, last + EVERY_MS - performance.now());
  timer = window.setTimeout(() => {
    last = performance.now();
    brushed.value = [from, to];
    send({ type: "brush", curve, from: Math.max(0, from), to: Math.min(90, to) });
  }, wait);
}
