/** The image in the place of a material's base colour: choose one, send one, take it off. */
import { useEffect } from "preact/hooks";
import { isImage } from "../document/texture";
import type { Term } from "../protocol";
import { IconButton } from "../ui/Button";
import { baseTexture } from "./colour";
import { FileOfImage } from "./FileOfImage";
import { ImageOptions } from "./ImageOptions";
import { imageOf, loadImages, offerToDelete, putImage, sending, sendOnto, takeOff } from "./images";

export function BaseImage({ material, terms }: { material: string; terms: readonly Term[] }) {
  useEffect(() => void loadImages(), []);
  const texture = baseTexture(terms);
  const shown = isImage(texture) ? texture : null;
  const image = shown === null ? undefined : imageOf(shown);
  return (
    <section class="base-image" aria-label="Image">
      <div class="base-image-row">
        {image !== undefined && <img src={image.thumbnail} alt="" width={24} height={24} />}
        <select
          aria-label="Image of the base colour"
          title="An image in the place of the base colour. An image file can be dropped on the object, too."
          value={shown ?? ""}
          onChange={(event) => {
            const chosen = imageOf(event.currentTarget.value);
            if (chosen === undefined) takeOff(material);
            else putImage(material, chosen);
          }}
        >
          <option value="">{shown === null && texture !== null ? "The scene’s own image" : "No image"}</option>
          <ImageOptions shown={shown} image={image} />
        </select>
        <FileOfImage label="File of an image" onFile={(file) => void sendOnto(material, file)} />
        {image !== undefined && (
          <IconButton icon="trash" label={`Delete the image ${image.name}`} onClick={() => offerToDelete(material, image)} />
        )}
      </div>
      <p class="aside" role="status">
        {sending.value}
      </p>
    </section>
  );
}
