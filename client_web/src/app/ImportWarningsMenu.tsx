/** A mark by the scene's name where its import had something to say, and the list of it. */
import { useState } from "preact/hooks";
import { warningCounts, ImportWarnings } from "../start/ImportWarnings";
import { scene } from "../state/scene";

export function ImportWarningsMenu() {
  const [open, setOpen] = useState(false);
  const warnings = scene.value?.warnings ?? [];
  if (warnings.length === 0) return null;
  const label = `What the import says: ${warningCounts(warnings)}`;
  return (
    <div class="menu" onKeyDown={(event) => event.key === "Escape" && setOpen(false)}>
      <button
        class={warnings.some(({ severity }) => severity === "unsupported") ? "remark-mark is-wrong" : "remark-mark"}
        aria-expanded={open}
        aria-label={label}
        title={label}
        onClick={() => setOpen(!open)}
      >
        ! {warnings.length}
      </button>
      {open && (
        <div class="menu-body remarks-menu">
          <ImportWarnings warnings={warnings} />
        </div>
      )}
    </div>
  );
}
