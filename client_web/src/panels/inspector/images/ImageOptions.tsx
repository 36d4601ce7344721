/** The images that a list offers, and the one that is shown where it is not here. */
import type { ImageBody } from "../../../protocol";
import { areListed, uploadedImages } from "./imageStore";

interface Props {
  /** What is named in the look; null: no image. */
  displayedImage: string | null;
  /** That image, where it is here. */
  image: ImageBody | undefined;
}

export function ImageOptions({ displayedImage, image }: Props) {
  return (
    <>
      {displayedImage !== null && image === undefined && <option value={displayedImage}>{areListed.value ? "An image that is not here" : "Loading…"}</option>}
      {uploadedImages.value.map((imageOption) => (
        <option key={imageOption.id} value={imageOption.texture}>
          {imageOption.name}
        </option>
      ))}
    </>
  );
}
