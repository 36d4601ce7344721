/** The image that a material emits, and its brightness. */
import { jsonPointer } from "../../../state/document/pointer";
import { editValue } from "../../../edit/edit";
import { look } from "../../../state/look";
import { selectLight } from "../../../state/selection";
import { beginDrag } from "../../../session/prepare";
import { LabeledSlider } from "../../../ui/LabeledSlider";
import { isAddedLight } from "../../lights/lightEdits";
import { meshLightOf } from "./emission";
import { assignEmission, removeEmissionImage } from "./imageStore";
import { MapImageField } from "./MapImageField";

export function EmissionImage({ material }: { material: string }) {
  const emitter = meshLightOf(look.value?.lights ?? {}, material);
  const isOwn = emitter !== null && !isAddedLight(emitter.name);
  return (
    <section aria-label="Emission">
      <MapImageField
        label="Emission map"
        title="The surface emits this image, and lights the scene by it."
        file="Load emission map…"
        material={material}
        displayedImage={emitter?.light.image ?? null}
        assign={assignEmission}
        unassign={removeEmissionImage}
        onOther={() => removeEmissionImage(material)}
      >
        <option value="">{isOwn ? "Original" : "None"}</option>
      </MapImageField>
      {emitter !== null && (
        <>
          <LabeledSlider
            label="Emission intensity"
            shortLabel="Intensity"
            title="Radiance of white in the image, times the emission of the light"
            value={emitter.light.intensity}
            initial={1}
            minimum={0.01}
            maximum={100}
            scale="log"
            unit="×"
            onChange={(value) => editValue("Intensity", jsonPointer("lights", emitter.name, "intensity"), value)}
            onHold={() => beginDrag(jsonPointer("lights", emitter.name))}
          />
          <p class="aside">
            Lights the scene as <button onClick={() => selectLight(emitter.name)}>{emitter.name}</button> in the list of
            lights.
          </p>
        </>
      )}
    </section>
  );
}
