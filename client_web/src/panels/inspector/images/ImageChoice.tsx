/** Chooses the image of a material map from uploaded ones or a file; also deletes images. */
import type { ComponentChildren } from "preact";
import { IconButton } from "../../../ui/IconButton";
import { ImageFileField } from "./ImageFileField";
import { ImageOptions } from "./ImageOptions";
import { imageOf, offerToDeleteImage, uploadAndAssign, type AssignImage } from "./imageStore";
import { serverUrl } from "../../../session/net/serverUrl";

export interface ImageChoiceProps {
  label: string;
  title: string;
  /** Label of the upload button. */
  file: string;
  material: string;
  /** The image's name in the look; null: no image. */
  displayedImage: string | null;
  /** The selected one of the other options, the children, if there is no image. */
  fallbackLabel?: string;
  children: ComponentChildren;
  assign: AssignImage;
  unassign: (material: string) => void | Promise<void>;
  /** An option other than an image was chosen. */
  onOther: (value: string) => void;
}

export function ImageChoice({
  label,
  title,
  file,
  material,
  displayedImage,
  fallbackLabel = "",
  children,
  assign,
  unassign,
  onOther,
}: ImageChoiceProps) {
  const image = displayedImage === null ? undefined : imageOf(displayedImage);
  const choose = (name: string) => {
    const selectedImage = imageOf(name);
    if (selectedImage === undefined) onOther(name);
    else void assign(material, selectedImage);
  };
  return (
    <div class="base-image-row">
      {image !== undefined && <img src={serverUrl(image.thumbnail)} alt="" width={24} height={24} />}
      <select
        aria-label={label}
        title={title}
        value={displayedImage ?? fallbackLabel}
        onChange={(event) => choose(event.currentTarget.value)}
      >
        {children}
        <ImageOptions displayedImage={displayedImage} image={image} />
      </select>
      <ImageFileField label={file} onFile={(selectedFile) => void uploadAndAssign(material, selectedFile, assign)} />
      {image !== undefined && (
        <IconButton
          icon="trash"
          label={`Delete ${image.name}`}
          onClick={() => offerToDeleteImage(material, image, unassign)}
        />
      )}
    </div>
  );
}
