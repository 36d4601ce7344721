/** What a term's width follows: the scene's own map of roughness, an image in its place, or none. */
import { useEffect } from "preact/hooks";
import { isImage } from "../document/texture";
import type { Term } from "../protocol";
import { ImageChoice } from "./ImageChoice";
import { imageOf, letGoOver, loadImages, offerToDelete, putRoughness, sendOnto, takeRoughnessOff } from "./images";

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
  const image = shown === null ? undefined : imageOf(shown);
  const put = (of: string, given: NonNullable<typeof image>) => putRoughness(of, given, index);
  const choose = (name: string) => {
    const chosen = imageOf(name);
    if (chosen !== undefined) put(material, chosen);
    else if (shown !== null && (name === "" || name === "map")) takeRoughnessOff(material);
    else onChange(name === "map");
  };
  return (
    <div class="map-image" onDrop={() => letGoOver(Promise.resolve(material), put)}>
      <span class="param-label">Roughness map</span>
      <ImageChoice
        label="Roughness map"
        title="An image whose green says how rough the surface is. An image file can be dropped here, too."
        file="File of a map of roughness"
        value={shown ?? (value === true ? "map" : "")}
        shown={shown}
        image={image}
        onChoose={choose}
        onFile={(file) => void sendOnto(material, file, put)}
        onDelete={(gone) => offerToDelete(material, gone, takeRoughnessOff)}
      >
        <option value="">None</option>
        {hasOwn && <option value="map">As in the scene</option>}
      </ImageChoice>
    </div>
  );
}
