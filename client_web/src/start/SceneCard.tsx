import { useState } from "preact/hooks";
import type { SceneBody } from "../protocol";
import { mayEdit } from "../state/sessionUser";
import { IconButton } from "../ui/IconButton";
import { formatCount } from "../ui/scale";
import { BakeProgress } from "./BakeProgress";
import { warningCounts, ImportWarnings } from "./ImportWarnings";

interface SceneCardProps {
  scene: SceneBody;
  onOpen(): void;
  onBake(): void;
  onDelete(): void;
  /** Make the same scene on a ground. */
  onAddGround(): void;
  /** Its first bake is ready. */
  onReady(): void;
}

/** The scene's thumbnail; the server paints it when it is first asked for, which takes seconds. */
function CardImage({ url }: { url: string }) {
  const [placeholder, setPlaceholder] = useState("painting its picture…");
  return (
    <>
      <span class="no-picture">{placeholder}</span>
      <img src={url} alt="" loading="lazy" onLoad={() => setPlaceholder("")} onError={() => setPlaceholder("no picture")} />
    </>
  );
}

/** One scene: a click anywhere on the card opens it, but for the card's own buttons. */
export function SceneCard({ scene, onOpen, onBake, onDelete, onAddGround, onReady }: SceneCardProps) {
  return (
    <li class="scene-card">
      <button class="scene-open" onClick={onOpen} aria-label={`Open ${scene.name}`}>
        {scene.thumbnail === null ? <BakeProgress scene={scene} onReady={onReady} /> : <CardImage url={scene.thumbnail} />}
      </button>
      <div class="scene-text">
        <b title={scene.name}>{scene.name}</b>
        <small>
          {formatCount(scene.triangles)}&nbsp;{scene.triangles === 1 ? "triangle" : "triangles"} · {scene.materials.length}&nbsp;
          {scene.materials.length === 1 ? "material" : "materials"} · {scene.views.length}&nbsp;
          {scene.views.length === 1 ? "view" : "views"}
        </small>
        {scene.warnings.length > 0 && (
          <details>
            <summary>Not as in the file: {warningCounts(scene.warnings)}</summary>
            <ImportWarnings warnings={scene.warnings} />
          </details>
        )}
      </div>
      <div class="scene-actions" inert={!mayEdit.value}>
        <button onClick={onBake}>Bake…</button>
        {!scene.materials.some(({ shadow_catcher }) => shadow_catcher) && (
          <button
            onClick={onAddGround}
            aria-label={`Put ${scene.name} on a ground`}
            title="A new scene, the same on a ground that catches shadows"
          >
            On a ground
          </button>
        )}
        <IconButton icon="trash" label={`Delete ${scene.name}`} onClick={onDelete} />
      </div>
    </li>
  );
}
