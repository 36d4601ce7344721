/** What light the open bake has and how large it is; bake the scene again with other light, finer or coarser. */
import { useState } from "preact/hooks";
import type { Frame } from "../cameras/orbit";
import { wordsOf } from "../scene/methods";
import { startFullBake } from "../scene/takeover";
import { PresetList } from "../start/PresetList";
import { bake, bakes, method } from "../state/bakes";
import { scene } from "../state/scene";
import { view, views } from "../state/views";
import { attempt } from "../ui/toasts";

/** The camera of the view in hand. */
function cameraShown(): Frame | null {
  const camera = view.value?.camera;
  return camera === undefined ? null : { to_world: camera.to_world, yfov: (camera.yfov * 180) / Math.PI };
}

export function BakeMenu() {
  const [open, setOpen] = useState(false);
  const current = scene.value;
  const size = view.value;
  const words = wordsOf(method.value);
  const isOld = bakes.value.some(({ id, is_current }) => id === bake.value && !is_current);
  return (
    <div class="menu" onKeyDown={(event) => event.key === "Escape" && setOpen(false)}>
      <button
        aria-expanded={open}
        disabled={current === null}
        title={size === null ? "Bake" : `${words.label}. Bake again, with other light or another size`}
        onClick={() => setOpen(!open)}
      >
        {size === null ? "Bake" : `${size.width}×${size.height}, ${words.short}`} ▾
      </button>
      {open && current !== null && (
        <div class="menu-body">
          <p>Bake this scene again. The picture stays; the new bake takes its place when it is ready.</p>
          {isOld && <p>Another version of relume made the one you see. It is as good as it was; this one may differ.</p>}
          <PresetList
            scene={current}
            method={words.name}
            views={views.value.map((baked) => baked.name)}
            {...(size === null ? {} : { size: [size.width, size.height] })}
            from={cameraShown()}
            action="Bake"
            onChoose={(choice) => {
              setOpen(false);
              void attempt(() => startFullBake(current, choice));
            }}
          />
        </div>
      )}
    </div>
  );
}
