/** How the screens show the pictures they have; nothing of it is an edit. */
import { signal } from "@preact/signals";

export const falseColour = signal(false);
/** Whether lights have handles in the picture. */
export const handlesOpen = signal(true);
export const wipe = signal<{ on: boolean; at: number }>({ on: false, at: 0.5 });
export const showBefore = signal(false);
/** While frames of another look are fetched, the screens keep what they show. */
export const held = signal(false);
/** Counts up with every frame that is drawn. */
export const drawn = signal(0);
