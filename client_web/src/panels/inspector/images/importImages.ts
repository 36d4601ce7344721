/** Applies dropped images to the matching maps of a material. */
import { selectMaterial, selectedMaterial } from "../../../state/selection";
import { isDisplayImage } from "../../../start/files/sceneFiles";
import { reportErrors, showNote, showError } from "../../../ui/toasts";
import { uploadImage } from "../../../session/net/upload";
import type { ImageBody } from "../../../protocol";
import {
  assignEmission,
  loadImages,
  assignRoughnessAndMetalness,
  assignMetalness,
  assignNormals,
  assignRoughness,
  assignSet,
  imageUploadProgress,
  uploadAndAssign,
  type AssignImage,
} from "./imageStore";
import { isColorName, detectMap } from "./mapNames";
import { planSet, setName, setMessage, type Slot } from "./textureSet";

/** The drop target of files: a material, and the map if known. */
export interface DropTarget {
  material: Promise<string | null>;
  assign: AssignImage | undefined;
}

let dropTarget: DropTarget | null = null;

/** Record a drop on a material, which may resolve later; on the field of `assign`, or anywhere on the object. */
export function onDrop(material: Promise<string | null>, assign?: AssignImage): void {
  dropTarget = { material, assign };
}

/** Take the target of the current drop; null if it is not a material. */
export function consumeDropTarget(): DropTarget | null {
  const target = dropTarget;
  dropTarget = null;
  return target;
}

/** True if a file can be a texture. An EXR is one if its name gives the kind of map; others are environments. */
export function isTextureFile(file: File): boolean {
  const isExr = file.name.toLowerCase().endsWith(".exr");
  return isDisplayImage(file) || (isExr && (detectMap(file.name) !== null || isColorName(file.name)));
}

/** How each kind of map is assigned, and its label. */
const ASSIGNMENTS: Record<string, { assign: AssignImage; as: string }> = {
  roughness: { assign: assignRoughness, as: "roughness map" },
  metal: { assign: assignMetalness, as: "metalness map" },
  normals: { assign: assignNormals, as: "normal map" },
  emission: { assign: assignEmission, as: "emission map" },
  "roughness and metal": { assign: assignRoughnessAndMetalness, as: "roughness (green) and metalness (blue) map" },
};

/** Unsupported kinds of maps, with the alternative. */
const UNSUPPORTED_MAPS: Record<string, string> = {
  gloss: "Gloss maps aren't supported; invert it to a roughness map.",
  height: "Height maps aren't supported; use a normal map instead.",
  "DirectX normals": "DirectX normal maps aren't supported; use the OpenGL version (green up).",
  occlusion: "AO maps aren't needed: occlusion is ray-traced.",
  opacity: "Opacity comes with the scene file.",
  specular: "Specular maps aren't supported; set Specular F0 instead.",
};

/** Upload the images of a set sequentially; returns the uploaded ones, and rejects the others with the reason. */
async function uploadSet(slots: ReadonlyMap<Slot, File>, reject: (name: string, reason: string) => void) {
  const files = [...new Set(slots.values())];
  const uploaded = new Map<File, ImageBody>();
  for (const [k, file] of files.entries()) {
    const progressLabel = `${k + 1} of ${files.length}: ${file.name}`;
    const onProgress = (fraction: number) =>
      (imageUploadProgress.value =
        fraction < 1 ? `Uploading ${progressLabel}, ${Math.round(100 * fraction)} %` : `Processing ${progressLabel}…`);
    onProgress(0);
    try {
      uploaded.set(file, await uploadImage(file, onProgress));
    } catch (error) {
      reject(file.name, (error as Error).message);
    }
  }
  return uploaded;
}

/** Apply a set of images to a material, in one step; one message reports the result. */
async function applySet(material: string, files: readonly File[]): Promise<void> {
  if (imageUploadProgress.value !== null) return showNote("Still uploading; try again in a moment.");
  const { slots, rejected } = planSet(files);
  selectMaterial(material); // the inspector shows the upload progress
  try {
    const uploaded = await uploadSet(slots, (name, reason) => rejected.push({ name, reason }));
    await loadImages();
    const set = new Map(
      [...slots].flatMap(([slot, file]) => (uploaded.has(file) ? [[slot, uploaded.get(file) as ImageBody]] : [])),
    );
    const label = `Textures · ${setName([...slots.values()].map(({ name }) => name))}`;
    const images = new Map(set);
    for (const [slot, reason] of await assignSet(label, material, set)) {
      rejected.push({ name: images.get(slot)?.name ?? slot, reason: `${slot}: ${reason}` });
    }
    const warnings = new Set([...set.values()].flatMap(({ warnings: imageWarnings }) => imageWarnings));
    showNote([setMessage(material, [...set.keys()], rejected), ...warnings].join(" "));
  } catch (error) {
    showError(error, "files");
  } finally {
    imageUploadProgress.value = null;
  }
}

/** Apply one image to the map given by its name, else as the base color. */
async function applyFile(material: string, file: File): Promise<void> {
  const map = detectMap(file.name);
  if (map === null) return uploadAndAssign(material, file);
  const useAsColor = { label: "Use as base color", run: () => void uploadAndAssign(material, file) };
  const assignment = ASSIGNMENTS[map];
  if (assignment !== undefined) {
    showNote(`“${file.name}” applied as ${assignment.as}.`, useAsColor);
    return uploadAndAssign(material, file, assignment.assign);
  }
  showNote(`“${file.name}” was not applied. ${UNSUPPORTED_MAPS[map] ?? ""}`, useAsColor);
}

/** Apply images dropped on the page: to the drop target, else to the selection. */
export async function applyImageFiles(files: readonly File[], target: DropTarget | null): Promise<void> {
  const material = (await reportErrors(async () => target?.material)) ?? selectedMaterial.value;
  const [first] = files;
  if (first === undefined) return;
  if (material === null) return showNote("Drop the image on an object, or select a material first.");
  if (files.length > 1) return applySet(material, files);
  await (target?.assign === undefined ? applyFile(material, first) : uploadAndAssign(material, first, target.assign));
}
