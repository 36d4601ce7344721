/** Thumbnails of the looks that were shown: of the image when input pauses, and again when it is exact; of a
 * step that is left before, as it is then. */
import { effect, untracked } from "@preact/signals";
import { isDeepEqual } from "../../state/document/difference";
import { history, type LookStep, type Step } from "../../edit/history";
import { isUpToDate } from "../../session/fidelityState";
import { copyPixels } from "../../render/pixels";
import { stage } from "../../render/renderStage";
import type { Look } from "../../protocol";
import { isLookFiltered } from "../../state/visibility/activeFilters";
import { connection } from "../../state/connection";
import { displayedFrames, isDisplayFrozen } from "../../state/display";
import { isFrameExact } from "../../state/fidelity";
import { look } from "../../state/look";
import { scene } from "../../state/scene";
import { storeThumbnail, hasThumbnail, thumbnailRevision } from "../../state/thumbnails";
import { completeLook } from "./abCompare";
import { renderThumbnail } from "./displayImage";
import { storeVariantThumbnail, thumbnailOf, variantThumbnail } from "./namedThumbnails";
import { attachSavedThumbnail, savedLooks } from "./savedLooks";

const IDLE_MS = 350;
const IDLE_INEXACT_MS = 700;
/** Looks whose thumbnail is not of their exact image. */
const inexact = new WeakSet<Look>();
let timer = 0;

/** A saved look without an image, or a variant of the scene's file, gets one when it is shown here. */
export function attachThumbnail(storedLook: Look, image: string): void {
  const isOf = (partial: unknown) => isDeepEqual(completeLook(partial as Partial<Look>), storedLook);
  for (const saved of savedLooks.peek()) if (thumbnailOf(saved.etag) === null && isOf(saved.look)) attachSavedThumbnail(saved, image);
  for (const { name, look: partial } of scene.peek()?.variants ?? []) {
    if (variantThumbnail(name) === null && isOf(partial)) storeVariantThumbnail(name, image);
  }
}

function takeThumbnail(current: Look): void {
  if (look.peek() !== current || isDisplayFrozen.peek() || isLookFiltered() || !stage.active.hasPixels) return;
  // while there is no connection, what is shown is of the step before
  if (connection.peek() !== "open" || !isUpToDate()) return;
  const image = renderThumbnail(stage.active.pixels, current.display);
  storeThumbnail(current, image);
  if (isFrameExact.peek()) {
    inexact.delete(current);
    attachThumbnail(current, image);
  } else inexact.add(current);
  thumbnailRevision.value += 1;
}

/** The look that a history has come to, as far as its steps say. */
function currentStep(): Look | null {
  const [steps, cursor] = [history.steps.value, history.cursor.value];
  const isCurrentLook = (step: Step) => step.kind === "look";
  const done = steps.slice(0, cursor).findLast(isCurrentLook) as LookStep | undefined;
  return done?.after ?? (steps.slice(cursor).find(isCurrentLook) as LookStep | undefined)?.before ?? null;
}

const isStepLook = (candidate: Look) => history.steps.peek().some((step) => step.before === candidate || step.after === candidate);

/** What the screen shows when a step is left is its image, if it has had none: input may be quicker than shading. */
function takePreviousThumbnail(left: Look): void {
  if (hasThumbnail(left) || isDisplayFrozen.peek() || !stage.active.hasPixels) return;
  const pixels = copyPixels(stage.active.pixels);
  window.setTimeout(() => {
    if (hasThumbnail(left)) return;
    storeThumbnail(left, renderThumbnail(pixels, left.display));
    inexact.add(left);
    thumbnailRevision.value += 1;
  });
}

/** Take thumbnails from now on, only when input pauses: one must never cost a frame. */
export function trackThumbnails(): void {
  let previous: Look | null = null;
  effect(() => {
    const [left, now] = [previous, currentStep()];
    previous = now;
    // of a drag the looks on the way are of no step
    if (left !== null && left !== now && isStepLook(left)) untracked(() => takePreviousThumbnail(left));
  });
  effect(() => {
    displayedFrames.value;
    const current = look.value;
    clearTimeout(timer);
    if (current === null || (hasThumbnail(current) && !(isFrameExact.value && inexact.has(current)))) return;
    timer = window.setTimeout(() => takeThumbnail(current), isFrameExact.value ? IDLE_MS : IDLE_INEXACT_MS);
  });
}
