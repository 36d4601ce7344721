/** The image that says where a material is metal: choose one, send one, take it off. */
import type { Term } from "../protocol";
import { ImageChoice } from "./ImageChoice";
import { imageOf, letGoOver, offerToDelete, putMetalness, sendOnto, takeMetalnessOff } from "./images";
import { mayBeMetal, metalnessOf } from "./metalness";

export function MetalImage({ material, terms }: { material: string; terms: readonly Term[] }) {
  if (!mayBeMetal(terms)) return null;
  const shown = metalnessOf(terms, imageOf);
  return (
    <section class="map-image" aria-label="Metalness" onDrop={() => letGoOver(Promise.resolve(material), putMetalness)}>
      <span class="param-label">Metalness map</span>
      <ImageChoice
        label="Metalness map"
        title="An image whose blue says where the surface is metal. An image file can be dropped here, too."
        file="File of a map of metalness"
        value={shown ?? ""}
        shown={shown}
        image={shown === null ? undefined : imageOf(shown)}
        onChoose={(name) => {
          const chosen = imageOf(name);
          if (chosen === undefined) takeMetalnessOff(material);
          else void putMetalness(material, chosen);
        }}
        onFile={(file) => void sendOnto(material, file, putMetalness)}
        onDelete={(image) => offerToDelete(material, image, takeMetalnessOff)}
      >
        <option value="">As in the scene</option>
      </ImageChoice>
    </section>
  );
}
