/** The image in the place of a material's normal map, and how strong its bumps are. */
import { pointer } from "../document/pointer";
import { edit } from "../edit/edit";
import type { MaterialLook } from "../protocol";
import { axes } from "../state/bakes";
import { LabelledSlider } from "../ui/LabelledSlider";
import { putNormals, takeNormalsOff } from "./images";
import { MapImage } from "./MapImage";

/** What an image of normals leaves as it is in the scene, in words; null where it is all of the material. */
function keptWords(mirrors: boolean): string | null {
  const kept = mirrors ? ["what it mirrors"] : [];
  if (axes.value.includes("bounces")) kept.push("the light that it sends to other surfaces");
  return kept.length === 0 ? null : `The image bends what is seen of the surface, not ${kept.join(" or ")}.`;
}

interface Props {
  material: string;
  of: MaterialLook;
  /** Whether it is a mirror in the scene. */
  mirrors: boolean;
}

export function NormalImage({ material, of, mirrors }: Props) {
  const map = of.normal_map ?? null;
  const kept = keptWords(mirrors);
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
      {map !== null && kept !== null && <p class="aside">{kept}</p>}
    </section>
  );
}
