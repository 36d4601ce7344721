/** The normal map of a material, and its strength. */
import { jsonPointer } from "../../../state/document/pointer";
import { editValue } from "../../../edit/edit";
import type { MaterialLook } from "../../../protocol";
import { LabeledSlider } from "../../../ui/LabeledSlider";
import { assignNormals, removeNormalMap } from "./imageStore";
import { MapImageField } from "./MapImageField";

interface Props {
  material: string;
  materialLook: MaterialLook;
  /** Whether it is a mirror in the scene. */
  mirrors: boolean;
}

export function NormalImage({ material, materialLook, mirrors }: Props) {
  const map = materialLook.normal_map ?? null;
  return (
    <section class="normal-image" aria-label="Normals">
      <MapImageField
        label="Normal map"
        title="An image whose colours say how the surface leans, its green upwards, as in glTF."
        file="File of a normal map"
        material={material}
        displayedImage={map?.image ?? null}
        assign={assignNormals}
        unassign={removeNormalMap}
        onOther={() => removeNormalMap(material)}
      >
        <option value="">As in the scene</option>
      </MapImageField>
      {map !== null && (
        <LabeledSlider
          label="Strength of the normal map"
          shortLabel="Strength"
          title="How far bumps lean; glTF calls it scale."
          value={map.scale ?? 1}
          initial={1}
          minimum={0}
          maximum={4}
          step={0.01}
          scale="linear"
          onChange={(scale) => editValue("Strength of bumps", jsonPointer("materials", material, "normal_map", "scale"), scale)}
        />
      )}
      {map !== null && mirrors && (
        <p class="aside">What is seen in this mirror stays as it was baked: the image does not bend it.</p>
      )}
    </section>
  );
}
