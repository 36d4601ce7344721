/** The image in the place of a material's normal map, and how strong its bumps are. */
import { pointer } from "../document/pointer";
import { edit } from "../edit/edit";
import type { MaterialLook } from "../protocol";
import { LabelledSlider } from "../ui/LabelledSlider";
import { putNormals, takeNormalsOff } from "./images";
import { MapImage } from "./MapImage";

interface Props {
  material: string;
  of: MaterialLook;
  /** Whether it is a mirror in the scene. */
  mirrors: boolean;
}

export function NormalImage({ material, of, mirrors }: Props) {
  const map = of.normal_map ?? null;
  return (
    <section class="normal-image" aria-label="Normals">
      <MapImage
        label="Normal map"
        title="An image whose colours say how the surface leans, its green upwards, as in glTF."
        file="File of a normal map"
        material={material}
        shown={map?.image ?? null}
        put={putNormals}
        off={takeNormalsOff}
        onOther={() => takeNormalsOff(material)}
      >
        <option value="">As in the scene</option>
      </MapImage>
      {map !== null && (
        <LabelledSlider
          label="Strength of the normal map"
          shown="Strength"
          title="How far bumps lean; glTF calls it scale."
          value={map.scale ?? 1}
          initial={1}
          minimum={0}
          maximum={4}
          step={0.01}
          scale="linear"
          onChange={(scale) => edit("Strength of bumps", pointer("materials", material, "normal_map", "scale"), scale)}
        />
      )}
      {map !== null && mirrors && (
        <p class="aside">What is seen in this mirror stays as it was baked: the image does not bend it.</p>
      )}
    </section>
  );
}
