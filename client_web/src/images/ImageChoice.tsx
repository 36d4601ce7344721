/** Chooses an image for some place of a material: from those that are here or from a file, and deletes one. */
import type { ComponentChildren } from "preact";
import type { ImageBody } from "../protocol";
import { IconButton } from "../ui/Button";
import { FileOfImage } from "./FileOfImage";
import { ImageOptions } from "./ImageOptions";

interface Props {
  label: string;
  title: string;
  /** What the button for a file is called. */
  file: string;
  /** The option that is chosen; those that are no images are the children. */
  value: string;
  children: ComponentChildren;
  /** What is named in the look; null: no image. And that image, where it is here. */
  shown: string | null;
  image: ImageBody | undefined;
  onChoose(value: string): void;
  onFile(file: File): void;
  onDelete(image: ImageBody): void;
}

export function ImageChoice({ label, title, file, value, children, shown, image, onChoose, onFile, onDelete }: Props) {
  return (
    <div class="base-image-row">
      {image !== undefined && <img src={image.thumbnail} alt="" width={24} height={24} />}
      <select aria-label={label} title={title} value={value} onChange={(event) => onChoose(event.currentTarget.value)}>
        {children}
        <ImageOptions shown={shown} image={image} />
      </select>
      <FileOfImage label={file} onFile={onFile} />
      {image !== undefined && <IconButton icon="trash" label={`Delete the image ${image.name}`} onClick={() => onDelete(image)} />}
    </div>
  );
}
