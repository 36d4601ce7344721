/** The base-color texture of a material: choose, upload, remove. */
import { useEffect } from "preact/hooks";
import { isImageReference } from "../../../state/document/imageReference";
import type { Term } from "../../../protocol";
import { baseTexture } from "./baseColor";
import { ImageChoice } from "./ImageChoice";
import { baseOf, loadImages, assignImage, imageUploadProgress, unassign } from "./imageStore";

export function BaseColorImage({ material, terms }: { material: string; terms: readonly Term[] }) {
  const textureName = baseTexture(terms);
  useEffect(() => void loadImages(), [textureName]); // it may have been uploaded or generated elsewhere
  const texture = baseOf(terms);
  const displayedImage = isImageReference(texture) ? texture : null;
  return (
    <section class="base-image" aria-label="Base color">
      <ImageChoice
        label="Base color texture"
        title="Replaces the base color. You can also drop an image on the object."
        file="Load texture…"
        material={material}
        displayedImage={displayedImage}
        assign={assignImage}
        unassign={unassign}
        onOther={() => void unassign(material)}
      >
        <option value="">{displayedImage === null && texture !== null ? "Original texture" : "No texture"}</option>
      </ImageChoice>
      <p class="aside" role="status">
        {imageUploadProgress.value}
      </p>
    </section>
  );
}
