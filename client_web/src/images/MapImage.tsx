/** The image in the place of one of a material's maps: choose one, send one, drop one here, take it off. */
import type { ComponentChildren } from "preact";
import { ImageChoice } from "./ImageChoice";
import { imageOf, letGoOver, offerToDelete, sendOnto, type Put } from "./images";

interface Props {
  /** Of the map, as it is shown. */
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
  off(material: string): void;
  /** Another option than an image was chosen. */
  onOther(value: string): void;
}

export function MapImage({ label, title, file, material, shown, otherwise = "", children, put, off, onOther }: Props) {
  return (
    <div class="map-image" onDrop={() => letGoOver(Promise.resolve(material), put)}>
      <span class="param-label">{label}</span>
      <ImageChoice
        label={label}
        title={`${title} An image file can be dropped here, too.`}
        file={file}
        value={shown ?? otherwise}
        shown={shown}
        image={shown === null ? undefined : imageOf(shown)}
        onChoose={(name) => {
          const chosen = imageOf(name);
          if (chosen === undefined) onOther(name);
          else void put(material, chosen);
        }}
        onFile={(chosen) => void sendOnto(material, chosen, put)}
        onDelete={(image) => offerToDelete(material, image, off)}
      >
        {children}
      </ImageChoice>
    </div>
  );
}
