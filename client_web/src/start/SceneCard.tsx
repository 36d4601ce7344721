import { useState } from "preact/hooks";
import type { SceneBody } from "../protocol";
import { mayEdit } from "../state/me";
import { IconButton } from "../ui/Button";
import { formatCount } from "../ui/scale";
import { CardProgress } from "./CardProgress";
import { countsOf, Remarks } from "./Remarks";

interface Props {
  scene: SceneBody;
  onOpen(): void;
  onBake(): void;
  onDelete(): void;
  /** Make the same scene on a ground. */
  onGround(): void;
  /** Its first bake is ready. */
  onReady(): void;
}

/** The scene's thumbnail; the server paints it when it is first asked for, which takes seconds. */
function Picture({ of }: { of: string }) {
  const [words, setWords] = useState("painting its picture…");
  return (
    <>
      <span class="no-picture">{words}</span>
      <img src={of} alt="" loading="lazy" onLoad={() => setWords("")} onError={() => setWords("no picture")} />
    </>
  );
}

/** One scene: a click anywhere on the card opens it, but for the card's own buttons. */
export function SceneCard({ scene, onOpen, onBake, onDelete, onGround, onReady }: Props) {
  return (
    <li class="scene-card">
      <button class="scene-open" onClick={onOpen} aria-label={`Open ${scene.name}`}>
        {scene.thumbnail === null ? <CardProgress scene={scene} onReady={onReady} /> : <Picture of={scene.thumbnail} />}
      </button>
      <div class="scene-text">
        <b title={scene.name}>{scene.name}</b>
        <small>
          {formatCount(scene.triangles)}&nbsp;{scene.triangles === 1 ? "triangle" : "triangles"} · {scene.materials.length}&nbsp;
          {scene.materials.length === 1 ? "material" : "materials"} · {scene.views.length}&nbsp;
          {scene.views.length === 1 ? "view" : "views"}
        </small>
        {scene.remarks.length > 0 && (
          <details>
            <summary>Not as in the file: {countsOf(scene.remarks)}</summary>
            <Remarks remarks={scene.remarks} />
          </details>
        )}
      </div>
      <div class="scene-actions" inert={!mayEdit.value}>
        <button onClick={onBake}>Bake…</button>
        {!scene.materials.some(({ catcher }) => catcher) && (
          <button
            onClick={onGround}
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
