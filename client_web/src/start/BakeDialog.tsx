/** After an import, and on request: what a bake will cost. Not modal: the page stays usable. */
import { useEffect, useRef } from "preact/hooks";
import type { SceneBody } from "../protocol";
import { viewsToBake, type BakeChoice } from "../scene/bakeChoice";
import { DEFAULT_METHOD } from "../scene/methods";
import { IconButton } from "../ui/Button";
import { useReturnFocus } from "../ui/keepFocus";
import { PresetList } from "./PresetList";
import { Remarks } from "./Remarks";

interface Props {
  scene: SceneBody;
  onClose(): void;
  onOpen(choice: BakeChoice): void;
}

export function BakeDialog({ scene, onClose, onOpen }: Props) {
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
        A preview opens the editor at once; the bake you choose takes its place when it is ready, and no edit is lost.
      </p>
      {scene.remarks.length > 0 && <Remarks remarks={scene.remarks} />}
      <PresetList
        key={scene.id}
        scene={scene}
        method={DEFAULT_METHOD}
        views={viewsToBake(scene)}
        action="Open and bake"
        onChoose={onOpen}
      />
    </section>
  );
}
