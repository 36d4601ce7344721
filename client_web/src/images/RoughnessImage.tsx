/** What a term's width follows: the scene's own map of roughness, an image in its place, or none. */
import { useEffect } from "preact/hooks";
import { isImage } from "../document/texture";
import type { Term } from "../protocol";
import { MapImage } from "./MapImage";
import { loadImages, putRoughness, takeRoughnessOff } from "./images";

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
  const shown = isImage(value) ? value : null;
  return (
    <MapImage
      label="Roughness map"
      title="An image whose green says how rough the surface is."
      file="File of a map of roughness"
      material={material}
      shown={shown}
      otherwise={value === true ? "map" : ""}
      put={(of, given) => putRoughness(of, given, index)}
      off={takeRoughnessOff}
      onOther={(name) => {
        if (shown !== null && (name === "" || name === "map")) takeRoughnessOff(material);
        else onChange(name === "map");
      }}
    >
      <option value="">None</option>
      {(hasOwn || value === true) && <option value="map">{hasOwn ? "As in the scene" : "By finer bumps"}</option>}
    </MapImage>
  );
}
