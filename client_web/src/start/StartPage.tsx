/** The start page: import, built-in scenes, and the scenes as cards. */
import { useCallback, useEffect, useState } from "preact/hooks";
import { addGround, deleteScene, listScenes } from "../session/net/api";
import type { SceneBody } from "../protocol";
import type { BakeSettings } from "../session/scene/bakeSettings";
import { openScene } from "../session/scene/openScene";
import { reportErrors, showNote } from "../ui/toasts";
import { Account, ReadOnly } from "../app/account/Account";
import { mayEdit } from "../state/sessionUser";
import { BakeDialog } from "./BakeDialog";
import { ExampleScenes } from "./ExampleScenes";
import { DropZone } from "./DropZone";
import { SceneCard } from "./SceneCard";

function openInEditor(scene: SceneBody, choice?: BakeSettings): void {
  window.history.pushState(null, "", `?scene=${encodeURIComponent(scene.id)}`);
  void openScene(scene.id, undefined, choice);
}

export function StartPage() {
  const [scenes, setScenes] = useState<SceneBody[] | null>(null);
  const [sceneToBake, setSceneToBake] = useState<SceneBody | null>(null);
  const refresh = useCallback(() => void reportErrors(async () => setScenes(await listScenes())), []);
  useEffect(refresh, [refresh]);
  const onImported = (importedScene: SceneBody[]) => {
    if (importedScene.length === 1) setSceneToBake(importedScene[0] as SceneBody);
    else showNote(`${importedScene.length} scenes imported.`);
    refresh();
  };
  const confirmDelete = (scene: SceneBody) =>
    showNote(`Delete “${scene.name}” and its bakes? This can't be undone.`, {
      label: "Delete",
      run: () => void reportErrors(() => deleteScene(scene.id)).then(refresh),
    });
  const createOnGround = async (scene: SceneBody) => {
    const grounded = await reportErrors(() => addGround(scene.id));
    if (grounded !== undefined) onImported([grounded]);
  };
  return (
    <main class="start">
      <header>
        <h1>relume</h1>
        <p>Edit materials and lights in the finished render. Every drag updates the real shadows and reflections.</p>
        <Account />
      </header>
      <ReadOnly />
      {mayEdit.value && <DropZone onImported={onImported} />}
      {sceneToBake !== null && (
        <BakeDialog scene={sceneToBake} onClose={() => setSceneToBake(null)} onOpen={(choice) => openInEditor(sceneToBake, choice)} />
      )}
      {mayEdit.value && <ExampleScenes onOpen={openInEditor} />}
      <h2>Scenes</h2>
      {scenes === null && <p class="quiet">Loading scenes…</p>}
      {scenes?.length === 0 && <p class="quiet">No scenes yet. Open a built-in scene or drop your own above.</p>}
      <ul class="cards">
        {scenes?.map((scene) => (
          <SceneCard
            key={scene.id}
            scene={scene}
            onOpen={() => openInEditor(scene)}
            onBake={() => setSceneToBake(scene)}
            onDelete={() => confirmDelete(scene)}
            onAddGround={() => void createOnGround(scene)}
            onReady={refresh}
          />
        ))}
      </ul>
    </main>
  );
}
