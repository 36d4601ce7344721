/** The edited look, and the scene's own. */
import { computed, signal } from "@preact/signals";
import { DEFAULTS } from "../look.gen";
import { displayMatrix } from "../render/color/whiteBalance";
import type { Look, Term } from "../protocol";

export const look = signal<Look | null>(null);
/** The scene's own look, for resets. */
export const defaultLook = signal<Look | null>(null);
/** The display settings, applied without a round trip; a separate signal, so that other edits do not redraw the image twice. */
export const exposure = computed(() => look.value?.display.exposure ?? 0);
const temperature = computed(() => look.value?.display.temperature ?? DEFAULTS.display.temperature);
const tint = computed(() => look.value?.display.tint ?? DEFAULTS.display.tint);
export const contrast = computed(() => look.value?.display.contrast ?? DEFAULTS.display.contrast);
/** Exposure times white balance. */
export const displayGain = computed(() => displayMatrix(exposure.value, temperature.value, tint.value));
/** True with the environment that the bake was made for; in another one, "exact" means exact for this bake. */
export const usesBakedEnvironment = computed(() => (look.value?.environment.map ?? null) === null);
/** True for a BTF term, whose texels the server draws. */
export const isBtfTerm = (term: Term): boolean => term.model === "measured_btf";
