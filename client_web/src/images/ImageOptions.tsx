/** The images that a list offers, and the one that is shown where it is not here. */
import type { ImageBody } from "../protocol";
import { areListed, sentImages } from "./images";

interface Props {
  /** What is named in the look; null: no image. */
  shown: string | null;
  /** That image, where it is here. */
  image: ImageBody | undefined;
}

export function ImageOptions({ shown, image }: Props) {
  return (
    <>
      {shown !== null && image === undefined && <option value={shown}>{areListed.value ? "An image that is not here" : "Loading…"}</option>}
      {sentImages.value.map((each) => (
        <option key={each.id} value={each.texture}>
          {each.name}
        </option>
      ))}
    </>
  );
}
