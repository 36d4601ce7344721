/** Thumbnails of shown looks: taken when input pauses, again when the image is exact, and when a step is left earlier. */
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
/** Looks whose thumbnail shows an approximate image. */
const inexact = new WeakSet<Look>();
let timer = 0;

/** Set the thumbnail of a saved look or scene variant that has none, when it is shown. */
export function attachThumbnail(storedLook: Look, image: string): void {
  const isOf = (partial: unknown) => isDeepEqual(completeLook(partial as Partial<Look>), storedLook);
  for (const saved of savedLooks.peek()) if (thumbnailOf(saved.etag) === null && isOf(saved.look)) attachSavedThumbnail(saved, image);
  for (const { name, look: partial } of scene.peek()?.variants ?? []) {
    if (variantThumbnail(name) === null && isOf(partial)) storeVariantThumbnail(name, image);
  }
}

function takeThumbnail(current: Look): void {
  if (look.peek() !== current || isDisplayFrozen.peek() || isLookFiltered() || !stage.active.hasPixels) return;
  // without a connection, the image is of the previous step
  if (connection.peek() !== "open" || !isUpToDate()) return;
  const image = renderThumbnail(stage.active.pixels, current.display);
  storeThumbnail(current, image);
  if (isFrameExact.peek()) {
    inexact.delete(current);
    attachThumbnail(current, image);
  } else inexact.add(current);
  thumbnailRevision.value += 1;
}

/** The look at the history's cursor, if its steps contain it. */
function currentStep(): Look | null {
  const [steps, cursor] = [history.steps.value, history.cursor.value];
  const isCurrentLook = (step: Step): step is LookStep => step.kind === "look";
  const done = steps.slice(0, cursor).findLast(isCurrentLook);
  return done?.after ?? steps.slice(cursor).find(isCurrentLook)?.before ?? null;
}

const isStepLook = (candidate: Look) => history.steps.peek().some((step) => step.before === candidate || step.after === candidate);

/** Take a step's thumbnail when it is left, if it has none: input may be faster than shading. */
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

/** Take thumbnails from now on, only when input pauses, so that they never cost a frame. */
export function trackThumbnails(): void {
  let previous: Look | null = null;
  effect(() => {
    const [left, now] = [previous, currentStep()];
    previous = now;
    // looks during a drag belong to no step
    if (left !== null && left !== now && isStepLook(left)) untracked(() => takePreviousThumbnail(left));
  });
  effect(() => {
    void displayedFrames.value;
    const current = look.value;
    clearTimeout(timer);
    if (current === null || (hasThumbnail(current) && !(isFrameExact.value && inexact.has(current)))) return;
    timer = window.setTimeout(() => takeThumbnail(current), isFrameExact.value ? IDLE_MS : IDLE_INEXACT_MS);
  });
}
