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
  /** True if the scene has it as a mirror. */
  mirrors: boolean;
}

export function NormalImage({ material, materialLook, mirrors }: Props) {
  const map = materialLook.normal_map ?? null;
  return (
    <section class="normal-image" aria-label="Normals">
      <MapImageField
        label="Normal map"
        title="Tangent-space normals, OpenGL convention (green up)."
        file="Load normal map…"
        material={material}
        displayedImage={map?.image ?? null}
        assign={assignNormals}
        unassign={removeNormalMap}
        onOther={() => removeNormalMap(material)}
      >
        <option value="">Original</option>
      </MapImageField>
      {map !== null && (
        <LabeledSlider
          label="Normal map strength"
          shortLabel="Strength"
          title="Called scale in glTF"
          value={map.scale ?? 1}
          initial={1}
          minimum={0}
          maximum={4}
          step={0.01}
          scale="linear"
          onChange={(scale) =>
            editValue("Normal map strength", jsonPointer("materials", material, "normal_map", "scale"), scale)
          }
        />
      )}
      {map !== null && mirrors && (
        <p class="aside">Mirror reflections stay as baked: the normal map does not distort them.</p>
      )}
    </section>
  );
}
