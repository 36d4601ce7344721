/** Chooses an image for some place of a material: from those that are here or from a file, and deletes one. */
import type { ComponentChildren } from "preact";
import { IconButton } from "../ui/Button";
import { FileOfImage } from "./FileOfImage";
import { ImageOptions } from "./ImageOptions";
import { imageOf, offerToDelete, sendOnto, type Put } from "./images";

export interface Choice {
  label: string;
  title: string;
  /** What the button for a file is called. */
  file: string;
  material: string;
  /** What is named in the look; null: no image. */
  shown: string | null;
  /** The option that is chosen where that is none; those are the children. */
  otherwise?: string;
  children: ComponentChildren;
  put: Put;
  off(material: string): void | Promise<void>;
  /** Another option than an image was chosen. */
  onOther(value: string): void;
}

export function ImageChoice({ label, title, file, material, shown, otherwise = "", children, put, off, onOther }: Choice) {
  const image = shown === null ? undefined : imageOf(shown);
  const choose = (name: string) => {
    const chosen = imageOf(name);
    if (chosen === undefined) onOther(name);
    else void put(material, chosen);
  };
  return (
    <div class="base-image-row">
      {image !== undefined && <img src={image.thumbnail} alt="" width={24} height={24} />}
      <select aria-label={label} title={title} value={shown ?? otherwise} onChange={(event) => choose(event.currentTarget.value)}>
        {children}
        <ImageOptions shown={shown} image={image} />
      </select>
      <FileOfImage label={file} onFile={(chosen) => void sendOnto(material, chosen, put)} />
      {image !== undefined && (
        <IconButton icon="trash" label={`Delete the image ${image.name}`} onClick={() => offerToDelete(material, image, off)} />
      )}
    </div>
  );
}
