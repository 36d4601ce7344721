/** Curve → pixels: pointing at a stretch asks the server which pixels it lights. */
import { send } from "../live/connections";
import { stage } from "../picture/stage";
import { freezing } from "../state/connection";
import { brushed } from "../state/curveShape";
import { fidelity } from "../state/fidelity";
import { curvePath } from "../state/selection";
import { moves } from "../state/views";
import { lights } from "./settings";

const DWELL_MS = 120;
const EVERY_MS = 50;
const AGAIN_MS = 300;
let timer = 0;
let last = 0;

export function clearBrush(): void {
  clearTimeout(timer);
  timer = 0;
  if (brushed.peek() !== null) stage.clearBrush();
}

/** Whether the picture is of points, of which no curve is frozen: where the eye rests another takes its place. */
const isOfPoints = () => moves.peek() && (fidelity.peek() === "approximate" || fidelity.peek() === "preview");

/** Whether what knows the pixels is on its way: a curve that was opened is frozen first. */
const isOnItsWay = () => freezing.peek()?.state === "freezing" || isOfPoints();

/** Ask for the pixels of a stretch; at first only when the pointer rests, then at most every `EVERY_MS`; when the curve is
 * there, and of a view whose eye moves when that has come to rest. */
export function brush(from: number, to: number): void {
  const curve = curvePath.peek();
  if (!lights.peek() || curve === null) return;
  clearTimeout(timer);
  const wait = brushed.peek() === null ? DWELL_MS : Math.max(0, last + EVERY_MS - performance.now());
  const ask = () => {
    if (isOnItsWay()) {
      timer = window.setTimeout(ask, AGAIN_MS);
      return;
    }
    last = performance.now();
    brushed.value = [from, to];
    send({ type: "brush", curve, from: Math.max(0, from), to: Math.min(90, to) });
  };
  timer = window.setTimeout(ask, wait);
}
