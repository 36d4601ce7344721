/** The metalness image of a material: choose, upload, remove. */
import type { Term } from "../../../protocol";
import { MapImageField } from "./MapImageField";
import { imageOf, assignMetalness, removeMetalnessMap } from "./imageStore";
import { canBeMetal, metalnessOf } from "./metalness";

export function MetalnessImage({ material, terms }: { material: string; terms: readonly Term[] }) {
  if (!canBeMetal(terms)) return null;
  return (
    <MapImageField
      label="Metalness map"
      title="Metalness from the blue channel."
      file="Load metalness map…"
      material={material}
      displayedImage={metalnessOf(terms, imageOf)}
      assign={assignMetalness}
      unassign={removeMetalnessMap}
      onOther={() => removeMetalnessMap(material)}
    >
      <option value="">Original</option>
    </MapImageField>
  );
}
