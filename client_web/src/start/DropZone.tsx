/** Import: drop files anywhere on the page, or choose them; then the upload with its progress. */
import { useState } from "preact/hooks";
import { uploadScene } from "../net/upload";
import type { SceneBody } from "../protocol";
import { attempt, showError } from "../ui/toasts";
import { useFileDrop } from "../ui/useFileDrop";
import { ENVIRONMENT_SUFFIXES, SCENE_SUFFIXES, sortFiles, stem, type Chosen } from "./files";

const NOTHING: Chosen = { scene: null, environment: null, refused: [] };

export function DropZone({ onImported }: { onImported(scene: SceneBody): void }) {
  const [chosen, setChosen] = useState<Chosen>(NOTHING);
  const [ground, setGround] = useState(false);
  const [sent, setSent] = useState<number | null>(null);
  const take = (files: File[]) => {
    const next = sortFiles(files, chosen);
    if (next.refused.length > 0)
      showError(
        `${next.refused.join(", ")}: a scene is one of ${SCENE_SUFFIXES.join(" ")}, an environment one of ${ENVIRONMENT_SUFFIXES.join(" ")}. Put a scene of several files into a .zip.`,
      );
    setChosen(next);
  };
  const over = useFileDrop(take);
  const send = async (scene: File) => {
    setSent(0);
    const order = { scene, environment: chosen.environment, name: stem(scene.name), ground };
    const imported = await attempt(() => uploadScene(order, setSent));
    setSent(null);
    if (imported === undefined) return;
    setChosen(NOTHING);
    onImported(imported);
  };
  return (
    <section class={`drop ${over ? "over" : ""}`} aria-label="Import a scene">
      <p>
        <b>Drop a scene and an environment anywhere</b>, or{" "}
        <label class="file">
          choose files
          <input
            type="file"
            multiple
            accept={[...SCENE_SUFFIXES, ...ENVIRONMENT_SUFFIXES].join(",")}
            onChange={(event) => take([...(event.currentTarget.files ?? [])])}
          />
        </label>
        .
      </p>
      <p class="quiet">
        Scene: .glb, .obj, .ply, or a .zip of .gltf or .obj with the files that belong to it. Environment: .hdr or .exr;
        without one the scene is lit by a studio.
      </p>
      <div class="chosen">
        <span class={chosen.scene ? "" : "quiet"}>Scene: {chosen.scene?.name ?? "none"}</span>
        <span class={chosen.environment ? "" : "quiet"}>Environment: {chosen.environment?.name ?? "none"}</span>
        <label class="on-ground">
          <input type="checkbox" checked={ground} onChange={(event) => setGround(event.currentTarget.checked)} />
          Put it on a ground
        </label>
        {sent !== null ? (
          <>
            <progress max={1} value={sent} aria-label="Upload" />
            <span>{sent < 1 ? `Sending, ${Math.round(100 * sent)} %` : "The server reads the scene…"}</span>
          </>
        ) : (
          <button
            class="primary"
            disabled={chosen.scene === null}
            onClick={() => chosen.scene && void send(chosen.scene)}
          >
            Import
          </button>
        )}
      </div>
    </section>
  );
}
