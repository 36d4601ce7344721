/** Thumbnails of the looks that were shown: of the picture as it is when the hand rests, and again when it is exact. */
import { effect } from "@preact/signals";
import { isDrawn } from "../live/exactness";
import { stage } from "../picture/stage";
import type { Look } from "../protocol";
import { isPartOfLook } from "../seen/limits";
import { connection } from "../state/connection";
import { drawn, held } from "../state/display";
import { exact } from "../state/fidelity";
import { look } from "../state/look";
import { giveThumbnail, hasThumbnail, thumbnailsMade } from "../state/thumbnails";
import { completed } from "./compare";
import { thumbnail } from "./image";
import { keepThumbnail, shelf, thumbnailOf } from "./shelf";

const REST_MS = 350;
const REST_INEXACT_MS = 700;
/** Looks whose thumbnail is not of their exact picture. */
const inexact = new WeakSet<Look>();
let timer = 0;

/** A saved look that was made elsewhere gets its picture when it is first shown here. */
function giveToSaved(of: Look, image: string): void {
  const text = JSON.stringify(of);
  for (const saved of shelf.peek()) {
    if (thumbnailOf(saved.name) === null && JSON.stringify(completed(saved.look)) === text)
      keepThumbnail(saved.name, image);
  }
}

function take(current: Look): void {
  if (look.peek() !== current || held.peek() || isPartOfLook() || !stage.active.isThere) return;
  // while there is no connection, what is shown is of the step before
  if (connection.peek() !== "open" || !isDrawn()) return;
  const image = thumbnail(stage.active.pixels, current.display);
  giveThumbnail(current, image);
  if (exact.peek()) {
    inexact.delete(current);
    giveToSaved(current, image);
  } else inexact.add(current);
  thumbnailsMade.value += 1;
}

/** Take thumbnails from now on, only when the hand rests: one must never cost a frame. */
export function followThumbnails(): void {
  effect(() => {
    drawn.value;
    const current = look.value;
    clearTimeout(timer);
    if (current === null || (hasThumbnail(current) && !(exact.value && inexact.has(current)))) return;
    timer = window.setTimeout(() => take(current), exact.value ? REST_MS : REST_INEXACT_MS);
  });
}
