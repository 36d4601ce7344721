/** Scenes as cards; drop a scene and an environment anywhere. */
import { useEffect, useState } from "preact/hooks";
import { addGround, deleteScene, listScenes } from "../net/api";
import type { SceneBody } from "../protocol";
import type { BakeChoice } from "../scene/bakeChoice";
import { openScene } from "../scene/open";
import { attempt, note } from "../ui/toasts";
import { Account, ReadOnly } from "../account/Account";
import { mayEdit } from "../state/me";
import { BakeDialog } from "./BakeDialog";
import { BuiltIns } from "./BuiltIns";
import { DropZone } from "./DropZone";
import { SceneCard } from "./SceneCard";

function open(scene: SceneBody, choice?: BakeChoice): void {
  window.history.pushState(null, "", `?scene=${encodeURIComponent(scene.id)}`);
  void openScene(scene.id, undefined, choice);
}

export function StartPage() {
  const [scenes, setScenes] = useState<SceneBody[] | null>(null);
  const [planned, setPlanned] = useState<SceneBody | null>(null);
  const refresh = () => attempt(async () => setScenes(await listScenes()));
  useEffect(() => void refresh(), []);
  const imported = (news: SceneBody[]) => {
    if (news.length === 1) setPlanned(news[0] as SceneBody);
    else note(`${news.length} scenes are imported.`);
    void refresh();
  };
  const remove = (scene: SceneBody) =>
    note(`Delete “${scene.name}” with its bakes? This cannot be undone.`, {
      label: "Delete",
      run: () => void attempt(() => deleteScene(scene.id)).then(refresh),
    });
  const putOnGround = async (scene: SceneBody) => {
    const grounded = await attempt(() => addGround(scene.id));
    if (grounded !== undefined) imported([grounded]);
  };
  return (
    <main class="start">
      <header>
        <h1>relume</h1>
        <p>Edit materials in the finished picture, with its real shadows, while you drag a curve.</p>
        <Account />
      </header>
      <ReadOnly />
      {mayEdit.value && <DropZone onImported={imported} />}
      {planned !== null && (
        <BakeDialog scene={planned} onClose={() => setPlanned(null)} onOpen={(choice) => open(planned, choice)} />
      )}
      {mayEdit.value && <BuiltIns onOpen={open} />}
      <h2>Scenes</h2>
      {scenes === null && <p class="quiet">Looking for scenes…</p>}
      {scenes?.length === 0 && <p class="quiet">No scenes yet. Take a built-in one, or drop your own above.</p>}
      <ul class="cards">
        {scenes?.map((scene) => (
          <SceneCard
            key={scene.id}
            scene={scene}
            onOpen={() => open(scene)}
            onBake={() => setPlanned(scene)}
            onDelete={() => remove(scene)}
            onGround={() => void putOnGround(scene)}
            onReady={() => void refresh()}
          />
        ))}
      </ul>
    </main>
  );
}
