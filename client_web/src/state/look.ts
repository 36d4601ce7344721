/** The look as the user wants it, and the scene's own. */
import { computed, signal } from "@preact/signals";
import { isImage } from "../document/texture";
import type { Look, MaterialLook, Term } from "../protocol";
import { materialOf } from "./scene";

export const look = signal<Look | null>(null);
/** The scene's own look, for resets. */
export const defaultLook = signal<Look | null>(null);
/** The look's part that costs no round trip; apart, so that other edits do not redraw the picture twice. */
export const exposure = computed(() => look.value?.display.exposure ?? 0);
/** Whether the light is the one that the bake was made for; in another one "exact" is said of the bake's own answer. */
export const bakedLight = computed(() => (look.value?.environment.map ?? null) === null);
/** A term whose every texel looks different from every side: this browser draws the mean of them. */
export const isTexels = (term: Term): boolean => term.model === "measured_btf";
/** Whether a material shows an image that is projected, for it has no places in textures: this browser knows no others. */
const showsProjected = (name: string, { terms, normal_map }: MaterialLook) =>
  materialOf(name)?.is_projected === true && ((normal_map ?? null) !== null || terms.some(({ texture }) => isImage(texture)));
/** Whether any material shows either. */
export const hasTexels = computed(() =>
  Object.entries(look.value?.materials ?? {}).some(([name, of]) => of.terms.some(isTexels) || showsProjected(name, of)),
);
