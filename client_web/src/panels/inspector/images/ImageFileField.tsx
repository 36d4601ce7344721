/** A button that uploads an image file. */
import { useRef } from "preact/hooks";
import { IMAGE_SUFFIXES } from "../../../start/files/sceneFiles";
import { imageUploadProgress } from "./imageStore";

const TYPES = [...IMAGE_SUFFIXES, ".exr"].join(",");

interface Props {
  /** The tooltip: purpose of the image. */
  label: string;
  onFile: (file: File) => void;
}

export function ImageFileField({ label, onFile }: Props) {
  const file = useRef<HTMLInputElement>(null);
  return (
    <>
      <button
        type="button"
        title={label}
        disabled={imageUploadProgress.value !== null}
        onClick={() => file.current?.click()}
      >
        Load…
      </button>
      <input
        ref={file}
        type="file"
        hidden
        accept={TYPES}
        aria-label={label}
        onChange={(event) => {
          const selectedFile = event.currentTarget.files?.[0];
          event.currentTarget.value = "";
          if (selectedFile !== undefined) onFile(selectedFile);
        }}
      />
    </>
  );
}
