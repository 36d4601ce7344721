/** The image in the place of a material's base colour: choose one, send one, take it off. */
import { useEffect } from "preact/hooks";
import { isImage } from "../document/texture";
import type { Term } from "../protocol";
import { baseTexture } from "./colour";
import { ImageChoice } from "./ImageChoice";
import { baseOf, loadImages, putImage, sending, takeOff } from "./images";

export function BaseImage({ material, terms }: { material: string; terms: readonly Term[] }) {
  const named = baseTexture(terms);
  useEffect(() => void loadImages(), [named]); // another may have sent it, or had it made
  const texture = baseOf(terms);
  const shown = isImage(texture) ? texture : null;
  return (
    <section class="base-image" aria-label="Image">
      <ImageChoice
        label="Image of the base colour"
        title="An image in the place of the base colour. An image file can be dropped on the object, too."
        file="File of an image"
        material={material}
        shown={shown}
        put={putImage}
        off={takeOff}
        onOther={() => void takeOff(material)}
      >
        <option value="">{shown === null && texture !== null ? "The scene’s own image" : "No image"}</option>
      </ImageChoice>
      <p class="aside" role="status">
        {sending.value}
      </p>
    </section>
  );
}
