/** Options for the uploaded images, plus the current one if it is missing. */
import type { ImageBody } from "../../../protocol";
import { areListed, uploadedImages } from "./imageStore";

interface Props {
  /** The image's name in the look; null: no image. */
  displayedImage: string | null;
  /** The current image, if it exists. */
  image: ImageBody | undefined;
}

export function ImageOptions({ displayedImage, image }: Props) {
  return (
    <>
      {displayedImage !== null && image === undefined && (
        <option value={displayedImage}>{areListed.value ? "Missing image" : "Loading…"}</option>
      )}
      {uploadedImages.value.map((imageOption) => (
        <option key={imageOption.id} value={imageOption.texture}>
          {imageOption.name}
        </option>
      ))}
    </>
  );
}
