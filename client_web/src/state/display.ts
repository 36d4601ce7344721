/** View settings of the image; none of them are edits. */
import { signal } from "@preact/signals";
import type { DifferenceMode } from "../render/color/difference";

export const falseColor = signal(false);
/** True if light handles are shown. */
export const handlesOpen = signal(true);
export const wipe = signal<{ isOn: boolean; position: number }>({ isOn: false, position: 0.5 });
/** The difference A − B in place of the image. */
export const difference = signal<DifferenceMode>("off");
export const isReferenceShown = signal(false);
/** True while a click in the image picks a gray. */
export const isPickingGray = signal(false);
/** True while frames of another look are captured: the canvases are frozen. */
export const isDisplayFrozen = signal(false);
/** Number of drawn frames. */
export const displayedFrames = signal(0);
