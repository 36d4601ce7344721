/** The image in the place of a material's base colour: choose one, send one, take it off. */
import { useEffect } from "preact/hooks";
import { isImage } from "../document/texture";
import type { Term } from "../protocol";
import { baseTexture } from "./colour";
import { ImageChoice } from "./ImageChoice";
import { baseOf, imageOf, loadImages, offerToDelete, putImage, sending, sendOnto, takeOff } from "./images";

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
        value={shown ?? ""}
        shown={shown}
        image={shown === null ? undefined : imageOf(shown)}
        onChoose={(name) => {
          const chosen = imageOf(name);
          if (chosen === undefined) void takeOff(material);
          else void putImage(material, chosen);
        }}
        onFile={(file) => void sendOnto(material, file)}
        onDelete={(image) => offerToDelete(material, image)}
      >
        <option value="">{shown === null && texture !== null ? "The scene’s own image" : "No image"}</option>
      </ImageChoice>
      <p class="aside" role="status">
        {sending.value}
      </p>
    </section>
  );
}
