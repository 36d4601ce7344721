/** Thumbnails of the looks that were shown: of the picture as it is when the hand rests, and again when it is exact. */
import { effect, signal } from "@preact/signals";
import { stage } from "../picture/stage";
import type { Look } from "../protocol";
import { isDrawn } from "../state/live";
import { connection, drawn, exact, held, look, seenPaths, soloLight } from "../state/store";
import { completed } from "./compare";
import { thumbnail } from "./image";
import { keepThumbnail, shelf, thumbnailOf } from "./shelf";

const REST_MS = 350;
const REST_INEXACT_MS = 700;
const images = new WeakMap<Look, string>();
/** Looks whose thumbnail is not of their exact picture. */
const inexact = new WeakSet<Look>();
/** Counts up with every thumbnail. */
export const thumbnailsMade = signal(0);
let timer = 0;

export function historyThumbnail(of: Look | undefined): string | null {
  thumbnailsMade.value;
  return of === undefined ? null : (images.get(of) ?? null);
}

/** Take up the picture of a look that was kept. */
export function giveThumbnail(of: Look, image: string): void {
  images.set(of, image);
}

/** A saved look that was made elsewhere gets its picture when it is first shown here. */
function giveToSaved(of: Look, image: string): void {
  const text = JSON.stringify(of);
  for (const saved of shelf.peek()) {
    if (thumbnailOf(saved.name) === null && JSON.stringify(completed(saved.look)) === text)
      keepThumbnail(saved.name, image);
  }
}

// only when the hand rests: a thumbnail must never cost a frame
effect(() => {
  drawn.value;
  const current = look.value;
  clearTimeout(timer);
  if (current === null || (images.has(current) && !(exact.value && inexact.has(current)))) return;
  timer = window.setTimeout(() => take(current), exact.value ? REST_MS : REST_INEXACT_MS);
});

function take(current: Look): void {
  // one light alone is no picture of the look, nor are some of its paths
  const partly = soloLight.peek() !== null || seenPaths.peek() !== null;
  if (look.peek() !== current || held.peek() || partly || !stage.active.isThere) return;
  // while there is no connection, what is shown is of the step before
  if (connection.peek() !== "open" || !isDrawn()) return;
  const image = thumbnail(stage.active.pixels, current.display);
  images.set(current, image);
  if (exact.peek()) {
    inexact.delete(current);
    giveToSaved(current, image);
  } else inexact.add(current);
  thumbnailsMade.value += 1;
}
