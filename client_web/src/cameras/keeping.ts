/** Cameras that people keep with a scene: kept, renamed, deleted; what is deleted can be had back for a moment. */
import type { CameraEntry } from "../protocol";
import { note } from "../ui/toasts";
import { deleteCamera, keepCamera, listCameras } from "./calls";
import type { Frame } from "./orbit";

/** Keep one under a name. `was`: the name of the one that it takes the place of; null: it is new. Raises where the name is
 * another's, or none. */
export async function keepAs(scene: string, name: string, frame: Frame, was: string | null): Promise<void> {
  if (name.includes("/")) throw new Error("Names of cameras have no slashes. Choose another name.");
  const others = name === was ? [] : await listCameras(scene);
  const other = others.find((one) => one.name === name);
  if (other !== undefined) {
    throw new Error(
      other.is_placed
        ? `There is a camera “${name}” already. Choose another name.`
        : `“${name}” is one of the scene’s own cameras, which stay as they are. Choose another name.`,
    );
  }
  await keepCamera(scene, name, frame);
  if (was !== null && was !== name) await deleteCamera(scene, was);
}

/** Delete one; `back` hears when it has been had back. */
export async function removeCamera(scene: string, camera: CameraEntry, back: (name: string) => void): Promise<void> {
  await deleteCamera(scene, camera.name);
  note(`The camera “${camera.name}” is deleted.`, {
    label: "Undo",
    run: () => void keepCamera(scene, camera.name, camera).then(() => back(camera.name)),
  });
}
