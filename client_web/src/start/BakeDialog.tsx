/** Import preview, bake settings and costs, after an import or on request. Not modal: the page stays usable. */
import { useEffect, useRef, useState } from "preact/hooks";
import type { SceneBody } from "../protocol";
import type { SceneUpload } from "../session/net/upload";
import { viewsToBake, type BakeSettings } from "../session/scene/bakeSettings";
import { DEFAULT_BAKE_METHOD } from "../session/scene/bakeMethods";
import { IconButton } from "../ui/IconButton";
import { useReturnFocus } from "../ui/restoreFocus";
import { ImportPreview } from "./ImportPreview";
import { ImportWarnings } from "./ImportWarnings";
import { Presets } from "./Presets";
import { useReimport } from "./useReimport";

interface BakeDialogProps {
  scene: SceneBody;
  /** The import of the scene; null if the page does not have its files. */
  upload: SceneUpload | null;
  /** Called with the scene of an import with other options, and the id of the one before. */
  onReplaced: (scene: SceneBody, replaced: string) => void;
  onClose: () => void;
  onOpen: (choice: BakeSettings) => void;
}

export function BakeDialog({ scene, upload, onReplaced, onClose, onOpen }: BakeDialogProps) {
  const panel = useRef<HTMLElement>(null);
  const [drawnScene, setDrawnScene] = useState("");
  const reimport = useReimport(scene, upload, onReplaced);
  useReturnFocus(panel);
  useEffect(() => {
    panel.current?.focus();
    panel.current?.scrollIntoView({ block: "nearest" });
  }, []);
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
      <ImportPreview
        scene={scene}
        reimport={upload === null ? null : reimport}
        onDrawn={() => setDrawnScene(scene.id)}
      />
      {scene.warnings.length > 0 && <ImportWarnings warnings={scene.warnings} />}
      <p>You can start on a quick preview; the full bake replaces it when ready and keeps your edits.</p>
      <div class="bake-settings" inert={reimport.isBusy}>
        <Presets
          key={scene.id}
          scene={scene}
          method={DEFAULT_BAKE_METHOD}
          views={viewsToBake(scene)}
          action="Open and bake"
          plansWait={drawnScene !== scene.id}
          onChoose={onOpen}
        />
      </div>
    </section>
  );
}
