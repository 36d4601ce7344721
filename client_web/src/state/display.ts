/** How the screens show the images they have; nothing of it is an edit. */
import { signal } from "@preact/signals";

export const falseColor = signal(false);
/** Whether lights have handles in the image. */
export const handlesOpen = signal(true);
export const wipe = signal<{ isOn: boolean; position: number }>({ isOn: false, position: 0.5 });
export const isReferenceShown = signal(false);
/** While frames of another look are fetched, the canvases are frozen. */
export const isDisplayFrozen = signal(false);
/** Counts up with every frame that is drawn. */
export const displayedFrames = signal(0);
