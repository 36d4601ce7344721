/** Small images of the looks that were shown in this visit. */
import { signal } from "@preact/signals";
import type { Look } from "../protocol";

const lookThumbnails = new WeakMap<Look, string>();
/** Counts up with every thumbnail. */
export const thumbnailRevision = signal(0);

/** A data URL, null where the look has no image. */
export function lookThumbnail(thumbnailLook: Look | undefined): string | null {
  thumbnailRevision.value;
  return thumbnailLook === undefined ? null : (lookThumbnails.get(thumbnailLook) ?? null);
}

export function hasThumbnail(thumbnailLook: Look): boolean {
  return lookThumbnails.has(thumbnailLook);
}

/** Keep a look's image. */
export function storeThumbnail(thumbnailLook: Look, image: string): void {
  lookThumbnails.set(thumbnailLook, image);
}
