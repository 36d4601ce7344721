import { useState } from "preact/hooks";
import type { SceneBody } from "../protocol";
import { clayUrl } from "../session/net/api";
import { mayEdit } from "../state/sessionUser";
import { ClayImage } from "../ui/ClayImage";
import { IconButton } from "../ui/IconButton";
import { formatCount } from "../ui/scale";
import { BakeProgress } from "./BakeProgress";
import { warningCounts, ImportWarnings } from "./ImportWarnings";
import { serverUrl } from "../session/net/serverUrl";

interface SceneCardProps {
  scene: SceneBody;
  onOpen: () => void;
  onBake: () => void;
  onDelete: () => void;
  /** Create a copy with a ground plane. */
  onAddGround: () => void;
  /** Called when the first bake is ready. */
  onReady: () => void;
}

const CLAY_WIDTH = 320;

/** The scene's thumbnail; the server renders it on first request, which takes seconds. */
function CardImage({ url }: { url: string }) {
  const [placeholder, setPlaceholder] = useState("Rendering preview…");
  return (
    <>
      <span class="no-picture">{placeholder}</span>
      <img
        src={serverUrl(url)}
        alt=""
        loading="lazy"
        onLoad={() => setPlaceholder("")}
        onError={() => setPlaceholder("No preview")}
      />
    </>
  );
}

/** One scene: a click on the card opens it, except on the card's buttons. */
export function SceneCard({ scene, onOpen, onBake, onDelete, onAddGround, onReady }: SceneCardProps) {
  return (
    <li class="scene-card">
      <button class="scene-open" onClick={onOpen} aria-label={`Open ${scene.name}`}>
        {scene.thumbnail === null ? (
          <>
            <ClayImage url={clayUrl(scene.id, CLAY_WIDTH)} label="" isLazy />
            <BakeProgress scene={scene} onReady={onReady} />
          </>
        ) : (
          <CardImage url={scene.thumbnail} />
        )}
      </button>
      <div class="scene-text">
        <b title={scene.name}>{scene.name}</b>
        <small>
          {formatCount(scene.triangles)}&nbsp;{scene.triangles === 1 ? "triangle" : "triangles"} ·{" "}
          {scene.materials.length}&nbsp;
          {scene.materials.length === 1 ? "material" : "materials"} · {scene.views.length}&nbsp;
          {scene.views.length === 1 ? "view" : "views"}
        </small>
        {scene.warnings.length > 0 && (
          <details>
            <summary>Differs from the file: {warningCounts(scene.warnings)}</summary>
            <ImportWarnings warnings={scene.warnings} />
          </details>
        )}
      </div>
      <div class="scene-actions" inert={!mayEdit.value}>
        <button onClick={onBake}>Bake…</button>
        {!scene.materials.some(({ shadow_catcher }) => shadow_catcher) && (
          <button
            onClick={onAddGround}
            aria-label={`Add ground plane to ${scene.name}`}
            title="Creates a copy with a ground plane (shadow catcher)"
          >
            Add ground
          </button>
        )}
        <IconButton icon="trash" label={`Delete ${scene.name}`} onClick={onDelete} />
      </div>
    </li>
  );
}
