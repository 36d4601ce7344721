/** Selects the views to bake; lists saved cameras, which can be moved and deleted here. */
import { useCallback, useEffect, useState } from "preact/hooks";
import { listCameras } from "../viewport/cameras/cameraRequests";
import { CameraPlacement } from "../viewport/cameras/CameraPlacement";
import { removeCamera } from "../viewport/cameras/savedCameras";
import type { CameraPose } from "../viewport/cameras/orbit";
import { getScene } from "../session/net/api";
import { MAX_VISIBLE_VIEWS, type SceneBody, type SceneView } from "../protocol";
import { IconButton } from "../ui/IconButton";
import { reportErrors } from "../ui/toasts";

interface ViewPickerProps {
  scene: SceneBody;
  /** Initial pose of a new camera; null: the scene's first camera. */
  from: CameraPose | null;
  selected: readonly string[];
  /** An updater: cameras may be saved and deleted while the user selects. */
  onChoose: (change: (views: readonly string[]) => string[]) => void;
}

interface CameraPlacementState {
  /** The camera being moved; null: a new one. */
  name: string | null;
  initialCamera: CameraPose | null;
}

export function ViewPicker({ scene, from, selected, onChoose }: ViewPickerProps) {
  const [views, setViews] = useState<SceneView[]>(scene.views);
  const [open, setOpen] = useState<CameraPlacementState | null>(null);
  const sortByScene = (names: readonly string[], sceneViews: readonly SceneView[]) =>
    sceneViews.map((view) => view.name).filter((name) => names.includes(name));

  const reloadViews = useCallback(async () => {
    const sceneViews = (await getScene(scene.id)).views;
    setViews(sceneViews);
    return sceneViews;
  }, [scene.id]);
  useEffect(() => void reportErrors(reloadViews), [reloadViews]); // cameras may have changed since the scene was listed
  const toggle = (name: string) =>
    onChoose((isSelected) => sortByScene(isSelected.includes(name) ? isSelected.filter((each) => each !== name) : [...isSelected, name], views));
  const onCameraSaved = async (name: string) => {
    setOpen(null);
    const all = await reportErrors(reloadViews);
    if (all !== undefined) onChoose((now) => sortByScene([...now, name], all));
  };
  const move = (name: string) =>
    reportErrors(async () => {
      const camera = (await listCameras(scene.id)).find((each) => each.name === name);
      setOpen({ name, initialCamera: camera ?? null });
    });
  const remove = (name: string) =>
    reportErrors(async () => {
      const camera = (await listCameras(scene.id)).find((each) => each.name === name);
      if (camera !== undefined) await removeCamera(scene.id, camera, (restore) => void onCameraSaved(restore));
      const remainingViews = await reloadViews();
      onChoose((now) => {
        const remaining = sortByScene(now, remainingViews);
        return remaining.length > 0 ? remaining : remainingViews.slice(0, 1).map((view) => view.name);
      });
    });
  const isLast = (name: string) => selected.length === 1 && selected[0] === name;
  return (
    <fieldset class="bake-views">
      <legend>
        Views{views.length > MAX_VISIBLE_VIEWS && ` (up to ${MAX_VISIBLE_VIEWS} shown at once)`}
      </legend>
      {views.map(({ name, is_placed }) => (
        <span class="bake-view" key={name}>
          <label>
            <input type="checkbox" checked={selected.includes(name)} disabled={isLast(name)} onChange={() => toggle(name)} />
            {name}
          </label>
          {is_placed && <IconButton icon="handles" label={`Move or rename ${name}`} onClick={() => void move(name)} />}
          {is_placed && <IconButton icon="trash" label={`Delete ${name}`} onClick={() => void remove(name)} />}
        </span>
      ))}
      <button type="button" onClick={() => setOpen({ name: null, initialCamera: from })}>
        New camera…
      </button>
      {open !== null && (
        <CameraPlacement
          scene={{ ...scene, views }}
          from={open.initialCamera}
          name={open.name}
          onSave={(name) => void onCameraSaved(name)}
          onClose={() => setOpen(null)}
        />
      )}
    </fieldset>
  );
}
