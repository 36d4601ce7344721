/** A button beside the scene's name that opens its import warnings. */
import { useState } from "preact/hooks";
import { warningCounts, ImportWarnings } from "../start/ImportWarnings";
import { scene } from "../state/scene";

export function ImportWarningsMenu() {
  const [open, setOpen] = useState(false);
  const warnings = scene.value?.warnings ?? [];
  if (warnings.length === 0) return null;
  const label = `Import warnings: ${warningCounts(warnings)}`;
  return (
    <div class="menu" onKeyDown={(event) => event.key === "Escape" && setOpen(false)}>
      <button
        class={
          warnings.some(({ severity }) => severity === "unsupported")
            ? "warnings-button has-differences"
            : "warnings-button"
        }
        aria-expanded={open}
        aria-label={label}
        title={label}
        onClick={() => setOpen(!open)}
      >
        ! {warnings.length}
      </button>
      {open && (
        <div class="menu-body warnings-menu">
          <ImportWarnings warnings={warnings} />
        </div>
      )}
    </div>
  );
}
