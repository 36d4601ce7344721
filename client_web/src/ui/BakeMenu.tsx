/** Bake the open scene finer or coarser; the plan stands beside each preset. */
import { useState } from "preact/hooks";
import { PresetList } from "../start/PresetList";
import { startFullBake } from "../state/open";
import { scene, view, views } from "../state/store";
import { attempt } from "./toasts";

export function BakeMenu() {
  const [open, setOpen] = useState(false);
  const current = scene.value;
  const size = view.value;
  return (
    <div class="menu" onKeyDown={(event) => event.key === "Escape" && setOpen(false)}>
      <button
        aria-expanded={open}
        disabled={current === null}
        title="Bake again, finer or coarser"
        onClick={() => setOpen(!open)}
      >
        {size === null ? "Bake" : `${size.width}×${size.height}`} ▾
      </button>
      {open && current !== null && (
        <div class="menu-body">
          <p>Bake this scene again. The picture stays; the new bake takes its place when it is ready.</p>
          <PresetList
            scene={current}
            views={views.value.map((baked) => baked.name)}
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
