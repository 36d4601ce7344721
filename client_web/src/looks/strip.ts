/** Thumbnails of the looks that were shown, made when their exact picture is there. */
import { effect, signal } from "@preact/signals";
import { stage } from "../picture/stage";
import type { Look } from "../protocol";
import { drawn, exact, held, look } from "../state/store";
import { completed } from "./compare";
import { thumbnail } from "./image";
import { keepThumbnail, shelf, thumbnailOf } from "./shelf";

const REST_MS = 350;
const images = new WeakMap<Look, string>();
/** Counts up with every thumbnail. */
export const thumbnailsMade = signal(0);
let timer = 0;

export function historyThumbnail(of: Look | undefined): string | null {
  thumbnailsMade.value;
  return of === undefined ? null : (images.get(of) ?? null);
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
  if (!exact.value || current === null || images.has(current)) return;
  timer = window.setTimeout(() => {
    if (look.peek() !== current || !exact.peek() || held.peek()) return;
    const image = thumbnail(stage.active.pixels, current.display);
    images.set(current, image);
    giveToSaved(current, image);
    thumbnailsMade.value += 1;
  }, REST_MS);
});
