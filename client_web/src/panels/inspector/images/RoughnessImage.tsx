/** The roughness map of a term: the original one, an image, or none. */
import { useEffect } from "preact/hooks";
import { isImageReference } from "../../../state/document/imageReference";
import { MapImageField } from "./MapImageField";
import { ROUGHNESS_MAP } from "./roughness";
import { loadImages, assignRoughness, removeRoughnessMap } from "./imageStore";

interface Props {
  material: string;
  index: number;
  value: string | null;
  /** True if the scene has a roughness map. */
  hasOwn: boolean;
  onChange: (value: string | null) => void;
}

export function RoughnessImage({ material, index, value, hasOwn, onChange }: Props) {
  useEffect(() => void loadImages(), []);
  const displayedImage = isImageReference(value) ? value : null;
  return (
    <MapImageField
      label="Roughness map"
      title="Roughness from the green channel."
      file="Load roughness map…"
      material={material}
      displayedImage={displayedImage}
      fallbackLabel={value === ROUGHNESS_MAP ? "map" : ""}
      assign={(target, image) => assignRoughness(target, image, index)}
      unassign={removeRoughnessMap}
      onOther={(name) => {
        if (displayedImage !== null && (name === "" || name === "map")) removeRoughnessMap(material);
        else onChange(name === "map" ? ROUGHNESS_MAP : null);
      }}
    >
      <option value="">None</option>
      {(hasOwn || value === ROUGHNESS_MAP) && <option value="map">{hasOwn ? "Original" : "From normal map"}</option>}
    </MapImageField>
  );
}
