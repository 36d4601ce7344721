/** A button that asks for the file of an image. */
import { useRef } from "preact/hooks";
import { sending } from "./images";

const TYPES = ".png,.jpg,.jpeg,.webp,.exr";

interface Props {
  /** What the image is for, in words. */
  label: string;
  onFile(file: File): void;
}

export function FileOfImage({ label, onFile }: Props) {
  const file = useRef<HTMLInputElement>(null);
  return (
    <>
      <button type="button" title={label} disabled={sending.value !== null} onClick={() => file.current?.click()}>
        Image…
      </button>
      <input
        ref={file}
        type="file"
        hidden
        accept={TYPES}
        aria-label={label}
        onChange={(event) => {
          const chosen = event.currentTarget.files?.[0];
          event.currentTarget.value = "";
          if (chosen !== undefined) onFile(chosen);
        }}
      />
    </>
  );
}
