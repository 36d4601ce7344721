/** Cameras saved with a scene: saved, renamed, deleted; a deletion can be undone for a moment. */
import type { CameraEntry } from "../../protocol";
import { showNote } from "../../ui/toasts";
import { deleteCamera, saveCamera, listCameras } from "./cameraRequests";
import type { CameraPose } from "./orbit";

/** Save a camera under a name. `previousName`: the name of the camera that it replaces; null: it is new. Raises where the name is
 * another's, or none. */
export async function saveCameraAs(scene: string, name: string, frame: CameraPose, previousName: string | null): Promise<void> {
  if (name.includes("/")) throw new Error("Names of cameras have no slashes. Choose another name.");
  const storedCameras = name === previousName ? [] : await listCameras(scene);
  const existing = storedCameras.find((stored) => stored.name === name);
  if (existing !== undefined) {
    throw new Error(
      existing.is_placed
        ? `There is a camera “${name}” already. Choose another name.`
        : `“${name}” is one of the scene’s own cameras, which stay as they are. Choose another name.`,
    );
  }
  await saveCamera(scene, name, frame);
  if (previousName !== null && previousName !== name) await deleteCamera(scene, previousName);
}

/** Delete a camera; `restore` is called when that is undone. */
export async function removeCamera(scene: string, camera: CameraEntry, restore: (name: string) => void): Promise<void> {
  await deleteCamera(scene, camera.name);
  showNote(`The camera “${camera.name}” is deleted.`, {
    label: "Undo",
    run: () => void saveCamera(scene, camera.name, camera).then(() => restore(camera.name)),
  });
}
