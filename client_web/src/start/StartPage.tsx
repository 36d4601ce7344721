/** The start page: import, built-in scenes, and the scenes as cards. */
import { useCallback, useEffect, useRef, useState } from "preact/hooks";
import { addGround, deleteScene, getScene, listScenes } from "../session/net/api";
import type { SceneBody } from "../protocol";
import type { SceneUpload } from "../session/net/upload";
import type { BakeSettings } from "../session/scene/bakeSettings";
import { openScene } from "../session/scene/openScene";
import { reportErrors, showNote } from "../ui/toasts";
import { Account, ReadOnly } from "../app/account/Account";
import { mayEdit } from "../state/sessionUser";
import { BakeDialog } from "./BakeDialog";
import { ExampleScenes } from "./ExampleScenes";
import { DropZone } from "./DropZone";
import { SceneCard } from "./SceneCard";
import type { ImportedScene } from "./useImport";
import { isDisposable, type KnownScenes } from "./useReimport";

function openInEditor(scene: SceneBody, choice?: BakeSettings): void {
  window.history.pushState(null, "", `?scene=${encodeURIComponent(scene.id)}`);
  void openScene(scene.id, undefined, choice);
}

/** A scene in the bake dialog. */
interface BakeDialogState {
  /** Number of the dialog: another one has a state of its own. */
  number: number;
  scene: SceneBody;
  upload: SceneUpload | null;
  /** Scenes of earlier imports. */
  known: KnownScenes;
}

/** Delete a scene after an import of its file with other options, if nobody can miss it. */
async function disposeReplaced(id: string, known: KnownScenes): Promise<void> {
  if (isDisposable(await getScene(id), known)) await deleteScene(id);
}

export function StartPage() {
  const [scenes, setScenes] = useState<SceneBody[] | null>(null);
  const numDialogs = useRef(0);
  const [dialog, setDialog] = useState<BakeDialogState | null>(null);
  const refresh = useCallback(() => void reportErrors(async () => setScenes(await listScenes())), []);
  useEffect(refresh, [refresh]);
  const openDialog = (scene: SceneBody, upload: SceneUpload | null = null) => {
    const known = scenes === null ? null : new Set(scenes.map(({ id }) => id));
    numDialogs.current += 1;
    setDialog({ number: numDialogs.current, scene, upload, known });
  };
  const onImported = (imported: ImportedScene[]) => {
    const [only] = imported;
    if (only !== undefined && imported.length === 1) openDialog(only.scene, only.upload);
    else showNote(`${imported.length} scenes imported.`);
    refresh();
  };
  const onReplaced = ({ number, known }: BakeDialogState, scene: SceneBody, replaced: string) => {
    setDialog((current) => (current?.number === number ? { ...current, scene } : current));
    // at once, since the card of the replaced scene would open nothing; the list follows
    setScenes((current) => current?.map((each) => (each.id === replaced ? scene : each)) ?? null);
    void reportErrors(() => (scene.id === replaced ? Promise.resolve() : disposeReplaced(replaced, known))).then(
      refresh,
    );
  };
  const confirmDelete = (scene: SceneBody) =>
    showNote(`Delete “${scene.name}” and its bakes? This can't be undone.`, {
      label: "Delete",
      run: () => void reportErrors(() => deleteScene(scene.id)).then(refresh),
    });
  const createOnGround = async (scene: SceneBody) => {
    const grounded = await reportErrors(() => addGround(scene.id));
    if (grounded === undefined) return;
    openDialog(grounded);
    refresh();
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
      {dialog !== null && (
        <BakeDialog
          key={dialog.number}
          scene={dialog.scene}
          upload={dialog.upload}
          onReplaced={(scene, replaced) => onReplaced(dialog, scene, replaced)}
          onClose={() => setDialog(null)}
          onOpen={(choice) => openInEditor(dialog.scene, choice)}
        />
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
            onBake={() => openDialog(scene)}
            onDelete={() => confirmDelete(scene)}
            onAddGround={() => void createOnGround(scene)}
            onReady={refresh}
          />
        ))}
      </ul>
    </main>
  );
}
