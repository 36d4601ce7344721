/** Looks that a browser cannot draw. */
import { computed } from "@preact/signals";
import type { MaterialLook } from "../protocol";
import { isImageReference } from "./document/imageReference";
import { isBtfTerm, look } from "./look";
import { materialOf } from "./scene";

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
