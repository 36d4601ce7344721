/** The image that says where a material is metal: choose one, send one, take it off. */
import type { Term } from "../protocol";
import { MapImage } from "./MapImage";
import { imageOf, putMetalness, takeMetalnessOff } from "./images";
import { mayBeMetal, metalnessOf } from "./metalness";

export function MetalImage({ material, terms }: { material: string; terms: readonly Term[] }) {
  if (!mayBeMetal(terms)) return null;
  return (
    <MapImage
      label="Metalness map"
      title="An image whose blue says where the surface is metal."
      file="File of a map of metalness"
      material={material}
      shown={metalnessOf(terms, imageOf)}
      put={putMetalness}
      off={takeMetalnessOff}
      onOther={() => takeMetalnessOff(material)}
    >
      <option value="">As in the scene</option>
    </MapImage>
  );
}
