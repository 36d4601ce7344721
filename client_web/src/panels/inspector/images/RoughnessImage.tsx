/** The roughness map of a term: the scene's own, an image, or none. */
import { useEffect } from "preact/hooks";
import { isImageReference } from "../../../state/document/imageReference";
import type { Term } from "../../../protocol";
import { MapImageField } from "./MapImageField";
import { loadImages, assignRoughness, removeRoughnessMap } from "./imageStore";

interface Props {
  material: string;
  index: number;
  value: NonNullable<Term["roughness_map"]>;
  /** Whether the scene has a map of its own. */
  hasOwn: boolean;
  onChange(value: boolean): void;
}

export function RoughnessImage({ material, index, value, hasOwn, onChange }: Props) {
  useEffect(() => void loadImages(), []);
  const displayedImage = isImageReference(value) ? value : null;
  return (
    <MapImageField
      label="Roughness map"
      title="An image whose green says how rough the surface is."
      file="File of a map of roughness"
      material={material}
      displayedImage={displayedImage}
      fallbackLabel={value === true ? "map" : ""}
      assign={(target, image) => assignRoughness(target, image, index)}
      unassign={removeRoughnessMap}
      onOther={(name) => {
        if (displayedImage !== null && (name === "" || name === "map")) removeRoughnessMap(material);
        else onChange(name === "map");
      }}
    >
      <option value="">None</option>
      {(hasOwn || value === true) && <option value="map">{hasOwn ? "As in the scene" : "By finer bumps"}</option>}
    </MapImageField>
  );
}
