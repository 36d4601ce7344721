/** Saves, renames and deletes cameras of a scene; its toast offers to undo a deletion. */
import type { CameraEntry } from "../../protocol";
import { showNote } from "../../ui/toasts";
import { deleteCamera, saveCamera, listCameras } from "./cameraRequests";
import type { CameraPose } from "./orbit";

/** Save a camera under a name. `previousName`: the camera that it replaces; null: a new one. Throws if the name is taken
 * or invalid. */
export async function saveCameraAs(
  scene: string,
  name: string,
  frame: CameraPose,
  previousName: string | null,
): Promise<void> {
  if (name.includes("/")) throw new Error("Camera names can't contain slashes. Choose another name.");
  const storedCameras = name === previousName ? [] : await listCameras(scene);
  const existing = storedCameras.find((stored) => stored.name === name);
  if (existing !== undefined) {
    throw new Error(
      existing.is_placed
        ? `A camera named “${name}” already exists. Choose another name.`
        : `“${name}” is a camera of the scene file and can't be overwritten. Choose another name.`,
    );
  }
  await saveCamera(scene, name, frame);
  if (previousName !== null && previousName !== name) await deleteCamera(scene, previousName);
}

/** Delete a camera; `restore` is called after an undo. */
export async function removeCamera(scene: string, camera: CameraEntry, restore: (name: string) => void): Promise<void> {
  await deleteCamera(scene, camera.name);
  showNote(`Camera “${camera.name}” deleted.`, {
    label: "Undo",
    run: () => void saveCamera(scene, camera.name, camera).then(() => restore(camera.name)),
  });
}
