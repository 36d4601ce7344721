/** The light around the scene: which one it is, how bright, which way it is turned, and its tint. */
import { ColorField } from "../inspector/ColorField";
import { edit } from "../state/edit";
import { hold } from "../state/live";
import { defaultLook, look } from "../state/store";
import { Slider } from "../ui/Slider";
import { EnvironmentGallery, ImportEnvironment } from "./EnvironmentGallery";

export function EnvironmentPanel() {
  const shown = look.value?.environment;
  const initial = defaultLook.value?.environment;
  if (shown === undefined || initial === undefined) return null;
  return (
    <>
      <header class="panel-head">
        <h2>Environment</h2>
        <ImportEnvironment />
      </header>
      <EnvironmentGallery />
      <div class="param alone">
        <span class="param-label">Brightness</span>
        <Slider
          label="Environment brightness"
          value={shown.scale}
          initial={initial.scale}
          minimum={0.01}
          maximum={100}
          scale="log"
          unit="×"
          onChange={(value) => edit("Environment brightness", "/environment/scale", value)}
        />
      </div>
      <div class="param alone">
        <span class="param-label">Rotation</span>
        <Slider
          label="Environment rotation"
          value={shown.rotation}
          initial={initial.rotation}
          minimum={-180}
          maximum={180}
          scale="linear"
          unit="°"
          onChange={(value) => edit("Environment rotation", "/environment/rotation", value)}
          onHold={() => hold("/environment/rotation")}
        />
      </div>
      <div class="param alone">
        <span class="param-label">Tint</span>
        <ColorField
          label="Environment tint"
          value={shown.color}
          initial={initial.color}
          onChange={(value) => edit("Environment tint", "/environment/color", value)}
        />
      </div>
    </>
  );
}
