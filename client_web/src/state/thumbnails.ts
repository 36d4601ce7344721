/** Small pictures of the looks that were shown in this visit. */
import { signal } from "@preact/signals";
import type { Look } from "../protocol";

const images = new WeakMap<Look, string>();
/** Counts up with every thumbnail. */
export const thumbnailsMade = signal(0);

/** A data URL, null where the look has no picture. */
export function lookThumbnail(of: Look | undefined): string | null {
  thumbnailsMade.value;
  return of === undefined ? null : (images.get(of) ?? null);
}

export function hasThumbnail(of: Look): boolean {
  return images.has(of);
}

/** Keep a look's picture. */
export function giveThumbnail(of: Look, image: string): void {
  images.set(of, image);
}
