/** The look as the user wants it, and the scene's own. */
import { computed, signal } from "@preact/signals";
import { isImageReference } from "./document/imageReference";
import type { Look, MaterialLook, Term } from "../protocol";
import { materialOf } from "./scene";

export const look = signal<Look | null>(null);
/** The scene's own look, for resets. */
export const defaultLook = signal<Look | null>(null);
/** The look's part that costs no round trip; apart, so that other edits do not redraw the image twice. */
export const exposure = computed(() => look.value?.display.exposure ?? 0);
/** Whether the light is the one that the bake was made for; in another one "exact" refers to the bake's own answer. */
export const usesBakedEnvironment = computed(() => (look.value?.environment.map ?? null) === null);
/** A term whose every texel looks different from every side: this browser draws the mean of them. */
export const isBtfTerm = (term: Term): boolean => term.model === "measured_btf";
/** Whether a material shows a tri-planar image, for it has no UVs: this browser supports no others. */
const usesTriPlanarMaps = (name: string, { terms, normal_map }: MaterialLook) =>
  materialOf(name)?.is_projected === true && ((normal_map ?? null) !== null || terms.some(({ texture }) => isImageReference(texture)));
/** Whether any material shows either. */
export const usesTexelShading = computed(() =>
  Object.entries(look.value?.materials ?? {}).some(([name, material]) => material.terms.some(isBtfTerm) || usesTriPlanarMaps(name, material)),
);
