/** The edited look, and the scene's own. */
import { computed, signal } from "@preact/signals";
import { DEFAULTS } from "../look.gen";
import { displayMatrix } from "../render/color/whiteBalance";
import { isImageReference } from "./document/imageReference";
import type { Look, MaterialLook, Term } from "../protocol";
import { materialOf } from "./scene";

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
/** True if a material without UVs has a tri-planar texture, which this browser cannot draw. */
const usesTriPlanarMaps = (name: string, { terms, normal_map }: MaterialLook) =>
  materialOf(name)?.is_projected === true &&
  ((normal_map ?? null) !== null || terms.some(({ texture }) => isImageReference(texture)));
/** True if the server draws the image: a material has a BTF, a tri-planar texture or transformed texture coordinates, or
 * is one of some objects. */
export const usesTexelShading = computed(() =>
  Object.entries(look.value?.materials ?? {}).some(
    ([name, material]) =>
      material.base != null ||
      material.uv != null ||
      material.terms.some(isBtfTerm) ||
      usesTriPlanarMaps(name, material),
  ),
);
