/** What a term's width follows: the scene's own map of roughness, an image in its place, or none. */
import { useEffect } from "preact/hooks";
import { isImage } from "../document/texture";
import type { Term } from "../protocol";
import { IconButton } from "../ui/Button";
import { FileOfImage } from "./FileOfImage";
import { ImageOptions } from "./ImageOptions";
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
    <div class="rough-image" onDrop={() => letGoOver(Promise.resolve(material), put)}>
      <span class="param-label">Roughness map</span>
      <div class="base-image-row">
        <select
          aria-label="Roughness map"
          title="An image whose green says how rough the surface is. An image file can be dropped here, too."
          value={shown ?? (value === true ? "map" : "")}
          onChange={(event) => choose(event.currentTarget.value)}
        >
          <option value="">None</option>
          {hasOwn && <option value="map">As in the scene</option>}
          <ImageOptions shown={shown} image={image} />
        </select>
        <FileOfImage label="File of a map of roughness" onFile={(file) => void sendOnto(material, file, put)} />
        {image !== undefined && (
          <IconButton
            icon="trash"
            label={`Delete the image ${image.name}`}
            onClick={() => offerToDelete(material, image, takeRoughnessOff)}
          />
        )}
      </div>
    </div>
  );
}
