/** The open bake's method and size; bakes the scene again with another method, size or quality. */
import { useState } from "preact/hooks";
import type { CameraPose } from "../viewport/cameras/orbit";
import { methodLabelsOf } from "../session/scene/bakeMethods";
import { startFullBake } from "../session/scene/bakeHandover";
import { Presets } from "../start/Presets";
import { bake, bakes, method } from "../state/bakes";
import { scene } from "../state/scene";
import { activeView, views } from "../state/views";
import { reportErrors } from "../ui/toasts";

/** The camera of the focused view. */
function displayedCamera(): CameraPose | null {
  const camera = activeView.value?.camera;
  return camera === undefined ? null : { to_world: camera.to_world, yfov: (camera.yfov * 180) / Math.PI };
}

export function BakeMenu() {
  const [open, setOpen] = useState(false);
  const current = scene.value;
  const size = activeView.value;
  const methodLabels = methodLabelsOf(method.value);
  const isOutdatedBake = bakes.value.some(({ id, is_current }) => id === bake.value && !is_current);
  return (
    <div class="menu" onKeyDown={(event) => event.key === "Escape" && setOpen(false)}>
      <button
        aria-expanded={open}
        disabled={current === null}
        title={size === null ? "Bake" : `${methodLabels.label}. Bake again with another method or size`}
        onClick={() => setOpen(!open)}
      >
        {size === null ? "Bake" : `${size.width}×${size.height}, ${methodLabels.short}`} ▾
      </button>
      {open && current !== null && (
        <div class="menu-body">
          <p>Bake this scene again. The picture stays; the new bake replaces it when ready and keeps your edits.</p>
          {isOutdatedBake && (
            <p>
              This bake was made by another version of relume. It still works; a new bake may look slightly different.
            </p>
          )}
          <Presets
            scene={current}
            method={methodLabels.name}
            views={views.value.map((baked) => baked.name)}
            {...(size === null ? {} : { size: [size.width, size.height] })}
            from={displayedCamera()}
            action="Bake"
            onChoose={(choice) => {
              setOpen(false);
              void reportErrors(() => startFullBake(current, choice));
            }}
          />
        </div>
      )}
    </div>
  );
}
