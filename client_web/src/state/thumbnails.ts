/** Thumbnails of looks shown in this session. */
import { signal } from "@preact/signals";
import type { Look } from "../protocol";

const lookThumbnails = new WeakMap<Look, string>();
/** Number of taken thumbnails. */
export const thumbnailRevision = signal(0);

/** A look's thumbnail as data URL; null without one. */
export function lookThumbnail(thumbnailLook: Look | undefined): string | null {
  void thumbnailRevision.value;
  return thumbnailLook === undefined ? null : (lookThumbnails.get(thumbnailLook) ?? null);
}

export function hasThumbnail(thumbnailLook: Look): boolean {
  return lookThumbnails.has(thumbnailLook);
}

/** Store a look's thumbnail. */
export function storeThumbnail(thumbnailLook: Look, image: string): void {
  lookThumbnails.set(thumbnailLook, image);
}
