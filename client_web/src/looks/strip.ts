/** Thumbnails of the looks that were shown, made when their exact picture is there. */
import { effect, signal } from "@preact/signals";
import { stage } from "../picture/stage";
import type { Look } from "../protocol";
import { drawn, exact, look } from "../state/store";
import { thumbnail } from "./image";

const REST_MS = 350;
const images = new WeakMap<Look, string>();
const made = signal(0);
let timer = 0;

export function historyThumbnail(of: Look | undefined): string | null {
  made.value;
  return of === undefined ? null : (images.get(of) ?? null);
}

// only when the hand rests: a thumbnail must never cost a frame
effect(() => {
  drawn.value;
  const current = look.value;
  clearTimeout(timer);
  if (!exact.value || current === null || images.has(current)) return;
  timer = window.setTimeout(() => {
    if (look.peek() !== current || !exact.peek() || stage.held) return;
    images.set(current, thumbnail(stage.capture(), current.display));
    made.value += 1;
  }, REST_MS);
});
