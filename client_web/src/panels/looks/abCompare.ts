/** A/B comparison: A is a stored image, B is the live one. */
import { effect, signal } from "@preact/signals";
import { applyCameras, currentCameras, type CameraSet } from "../../viewport/cameras/freeCamera";
import { isDeepEqual } from "../../state/document/difference";
import { replaceLook } from "../../edit/edit";
import { history } from "../../edit/history";
import { completeGroup } from "../lights/lightGroups";
import { completeLight } from "../lights/lightKinds";
import { withViews } from "../../session/requestFrames";
import { stage } from "../../render/renderStage";
import type { Look } from "../../protocol";
import { isLookFiltered } from "../../state/visibility/activeFilters";
import { connection } from "../../state/connection";
import { difference, isDisplayFrozen, isReferenceShown, wipe } from "../../state/display";
import { isFrameExact } from "../../state/fidelity";
import { defaultLook, look } from "../../state/look";
import { filmstripOpen } from "../../state/panels";
import { scene } from "../../state/scene";
import { lookThumbnail } from "../../state/thumbnails";
import { reportErrors, showNote } from "../../ui/toasts";
import { renderThumbnail } from "./displayImage";
import { currentView } from "./lookViews";
import { addLook, unusedName } from "./savedLooks";

/** The look whose image is stored as A, its label, and its cameras. */
export const sideA = signal<{ look: Look; label: string; cameras: CameraSet } | null>(null);

/** The look just saved, while its name is being edited. */
export const justSaved = signal<string | null>(null);

/** A full look: missing parts of a saved look come from the scene. */
export function completeLook(partial: Partial<Look>): Look {
  const base = defaultLook.value as Look;
  return {
    materials: { ...base.materials, ...partial.materials },
    environment: { ...base.environment, ...partial.environment },
    background: { ...base.background, ...partial.background },
    lights: {
      ...base.lights,
      ...Object.fromEntries(
        Object.entries(partial.lights ?? {}).map(([name, light]) => [name, completeLight(light, base.lights[name])]),
      ),
    },
    light_groups:
      partial.light_groups === undefined
        ? base.light_groups
        : Object.fromEntries(
            Object.entries(partial.light_groups).map(([name, group]) => [
              name,
              completeGroup(group, base.light_groups[name]),
            ]),
          ),
    transport: { ...base.transport, ...partial.transport },
    display: { ...base.display, ...partial.display },
  };
}

export function storeA(): void {
  if (look.value === null || !stage.active.hasPixels) return;
  sideA.value = { look: look.value, label: "kept", cameras: currentCameras() };
  stage.storeReference();
  showNote("Stored as A. W: wipe, hold C: show A.");
}

/** Store the image of another look as A, rendered by the server. */
export async function storeLookAsA(storedLook: Look, label: string): Promise<void> {
  await reportErrors(async () => {
    await withViews(storedLook, () => stage.storeReference());
    sideA.value = { look: storedLook, label, cameras: currentCameras() };
  });
}

/** Swap A and the live look, with their cameras. Undone steps are kept, since this only compares. */
export function swapWithA(): void {
  const [a, live] = [sideA.value, look.value];
  if (a === null || live === null) return;
  const cameras = currentCameras();
  stage.storeReference();
  if (!isDeepEqual(live, a.look) && history.commitUndone()) showNote("Your redo steps are kept in the history.");
  replaceLook("Swap A and B", a.look);
  applyCameras(a.cameras);
  sideA.value = { look: live, label: "swapped", cameras };
}

export function toggleWipe(): void {
  wipe.value = { ...wipe.value, isOn: !wipe.value.isOn };
}

export async function saveLook(): Promise<void> {
  const current = look.value;
  if (current === null) return;
  const image = isLookFiltered() ? lookThumbnail(current) : renderThumbnail(stage.active.pixels, current.display);
  const name = await reportErrors(unusedName);
  if (name === undefined) return;
  filmstripOpen.value = true;
  justSaved.value = name;
  await addLook(name, current, image, currentView()); // without an image, the thumbnail is taken when the look is shown exactly
}

// by default, A is the look that the scene opened with
let openedScene: string | null = null;
effect(() => {
  const id = scene.value?.id ?? null;
  if (!isFrameExact.value || id === null || id === openedScene) return;
  openedScene = id;
  sideA.value = { look: look.peek() as Look, label: "original", cameras: currentCameras() };
  stage.storeReference();
});

// a view that was hidden when A was stored has no image of A yet
effect(() => {
  const a = sideA.value;
  const isCompared = wipe.value.isOn || isReferenceShown.value || difference.value !== "off";
  if (a === null || !isCompared || !isFrameExact.value || isDisplayFrozen.value || connection.value !== "open") return;
  if (stage.displayed.some((image) => image.reference === null)) void storeLookAsA(a.look, a.label);
});
