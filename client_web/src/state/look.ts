/** The look as the user wants it, and the scene's own. */
import { computed, signal } from "@preact/signals";
import type { Look, Term } from "../protocol";

export const look = signal<Look | null>(null);
/** The scene's own look, for resets. */
export const defaultLook = signal<Look | null>(null);
/** The look's part that costs no round trip; apart, so that other edits do not redraw the picture twice. */
export const exposure = computed(() => look.value?.display.exposure ?? 0);
export const toneMap = computed(() => look.value?.display.tone_map ?? "agx");
/** Whether the light is the one that the bake was made for; in another one "exact" is said of the bake's own answer. */
export const bakedLight = computed(() => (look.value?.environment.map ?? null) === null);
/** A term whose every texel looks different from every side: this browser draws the mean of them. */
export const isTexels = (term: Term): boolean => term.model === "measured_btf";
/** Whether any material has such a term. */
export const hasTexels = computed(() => Object.values(look.value?.materials ?? {}).some(({ terms }) => terms.some(isTexels)));
