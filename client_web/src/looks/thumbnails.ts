/** Thumbnails of the looks that were shown: of the picture as it is when the hand rests, and again when it is exact. */
import { effect } from "@preact/signals";
import { isSame } from "../document/difference";
import { isDrawn } from "../live/exactness";
import { stage } from "../picture/stage";
import type { Look } from "../protocol";
import { isPartOfLook } from "../seen/limits";
import { connection } from "../state/connection";
import { drawn, held } from "../state/display";
import { exact } from "../state/fidelity";
import { look } from "../state/look";
import { scene } from "../state/scene";
import { giveThumbnail, hasThumbnail, thumbnailsMade } from "../state/thumbnails";
import { completed } from "./compare";
import { thumbnail } from "./image";
import { keepThumbnail, shelf, thumbnailOf, variantKey } from "./shelf";

const REST_MS = 350;
const REST_INEXACT_MS = 700;
/** Looks whose thumbnail is not of their exact picture. */
const inexact = new WeakSet<Look>();
let timer = 0;

/** A saved look that was made elsewhere, or a variant of the scene's file, gets its picture when it is first shown here. */
export function giveToNamed(of: Look, image: string): void {
  const saved = shelf.peek().map(({ name, look: partial }) => ({ key: name, partial }));
  const variants = (scene.peek()?.variants ?? []).map(({ name, look: partial }) => ({ key: variantKey(name), partial }));
  for (const { key, partial } of [...saved, ...variants]) {
    if (thumbnailOf(key) === null && isSame(completed(partial as Partial<Look>), of)) keepThumbnail(key, image);
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
    giveToNamed(current, image);
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
