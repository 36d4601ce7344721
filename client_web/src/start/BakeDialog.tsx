/** Bake settings and costs, after an import or on request. Not modal: the page stays usable. */
import { useEffect, useRef } from "preact/hooks";
import type { SceneBody } from "../protocol";
import { viewsToBake, type BakeSettings } from "../session/scene/bakeSettings";
import { DEFAULT_BAKE_METHOD } from "../session/scene/bakeMethods";
import { IconButton } from "../ui/IconButton";
import { useReturnFocus } from "../ui/restoreFocus";
import { Presets } from "./Presets";
import { ImportWarnings } from "./ImportWarnings";

interface BakeDialogProps {
  scene: SceneBody;
  onClose: () => void;
  onOpen: (choice: BakeSettings) => void;
}

export function BakeDialog({ scene, onClose, onOpen }: BakeDialogProps) {
  const panel = useRef<HTMLElement>(null);
  useReturnFocus(panel);
  useEffect(() => {
    panel.current?.focus();
    panel.current?.scrollIntoView({ block: "nearest" });
  }, [scene.id]);
  return (
    <section
      class="bake-dialog"
      ref={panel}
      tabIndex={-1}
      aria-label={`Bake ${scene.name}`}
      onKeyDown={(event) => event.key === "Escape" && onClose()}
    >
      <header class="panel-head">
        <h2>Bake “{scene.name}”</h2>
        <IconButton icon="close" label="Close" onClick={onClose} />
      </header>
      <p>
        You can start on a quick preview; the full bake replaces it when ready and keeps your edits.
      </p>
      {scene.warnings.length > 0 && <ImportWarnings warnings={scene.warnings} />}
      <Presets
        key={scene.id}
        scene={scene}
        method={DEFAULT_BAKE_METHOD}
        views={viewsToBake(scene)}
        action="Open and bake"
        onChoose={onOpen}
      />
    </section>
  );
}
