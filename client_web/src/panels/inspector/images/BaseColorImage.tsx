/** The base-color image of a material: choose, upload, remove. */
import { useEffect } from "preact/hooks";
import { isImageReference } from "../../../state/document/imageReference";
import type { Term } from "../../../protocol";
import { baseTexture } from "./baseColor";
import { ImageChoice } from "./ImageChoice";
import { baseOf, loadImages, assignImage, imageUploadProgress, unassign } from "./imageStore";

export function BaseColorImage({ material, terms }: { material: string; terms: readonly Term[] }) {
  const textureName = baseTexture(terms);
  useEffect(() => void loadImages(), [textureName]); // another may have sent it, or had it made
  const texture = baseOf(terms);
  const displayedImage = isImageReference(texture) ? texture : null;
  return (
    <section class="base-image" aria-label="Image">
      <ImageChoice
        label="Image of the base colour"
        title="An image in the place of the base colour. An image file can be dropped on the object, too."
        file="File of an image"
        material={material}
        displayedImage={displayedImage}
        assign={assignImage}
        unassign={unassign}
        onOther={() => void unassign(material)}
      >
        <option value="">{displayedImage === null && texture !== null ? "The scene’s own image" : "No image"}</option>
      </ImageChoice>
      <p class="aside" role="status">
        {imageUploadProgress.value}
      </p>
    </section>
  );
}
