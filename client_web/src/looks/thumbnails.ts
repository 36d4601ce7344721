/** Thumbnails of the looks that were shown: of the picture as it is when the hand rests, and again when it is exact; of a
 * step that is left before, as it is then. */
import { effect, untracked } from "@preact/signals";
import { isSame } from "../document/difference";
import { history, type LookStep, type Step } from "../edit/history";
import { isDrawn } from "../live/exactness";
import { copyPixels } from "../picture/pixels";
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
import { storeVariantThumbnail, thumbnailOf, variantThumbnail } from "./namedThumbnails";
import { giveThumbnailTo, shelf } from "./shelf";

const REST_MS = 350;
const REST_INEXACT_MS = 700;
/** Looks whose thumbnail is not of their exact picture. */
const inexact = new WeakSet<Look>();
let timer = 0;

/** A saved look without a picture, or a variant of the scene's file, gets one when it is shown here. */
export function giveToNamed(of: Look, image: string): void {
  const isOf = (partial: unknown) => isSame(completed(partial as Partial<Look>), of);
  for (const saved of shelf.peek()) if (thumbnailOf(saved.etag) === null && isOf(saved.look)) giveThumbnailTo(saved, image);
  for (const { name, look: partial } of scene.peek()?.variants ?? []) {
    if (variantThumbnail(name) === null && isOf(partial)) storeVariantThumbnail(name, image);
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

/** The look that a history has come to, as far as its steps say. */
function standing(): Look | null {
  const [steps, cursor] = [history.steps.value, history.cursor.value];
  const isOfLook = (step: Step) => step.of === "look";
  const done = steps.slice(0, cursor).findLast(isOfLook) as LookStep | undefined;
  return done?.after ?? (steps.slice(cursor).find(isOfLook) as LookStep | undefined)?.before ?? null;
}

const isOfStep = (of: Look) => history.steps.peek().some((step) => step.before === of || step.after === of);

/** What the screen shows when a step is left is its picture, if it has had none: a hand may be quicker than shading. */
function takeLeft(left: Look): void {
  if (hasThumbnail(left) || held.peek() || !stage.active.isThere) return;
  const pixels = copyPixels(stage.active.pixels);
  window.setTimeout(() => {
    if (hasThumbnail(left)) return;
    giveThumbnail(left, thumbnail(pixels, left.display));
    inexact.add(left);
    thumbnailsMade.value += 1;
  });
}

/** Take thumbnails from now on, only when the hand rests: one must never cost a frame. */
export function followThumbnails(): void {
  let before: Look | null = null;
  effect(() => {
    const [left, now] = [before, standing()];
    before = now;
    // of a drag the looks on the way are of no step
    if (left !== null && left !== now && isOfStep(left)) untracked(() => takeLeft(left));
  });
  effect(() => {
    drawn.value;
    const current = look.value;
    clearTimeout(timer);
    if (current === null || (hasThumbnail(current) && !(exact.value && inexact.has(current)))) return;
    timer = window.setTimeout(() => take(current), exact.value ? REST_MS : REST_INEXACT_MS);
  });
}
