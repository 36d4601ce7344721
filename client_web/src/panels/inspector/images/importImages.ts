/** Dropped images: applied to the material, and to the map that fits. */
import { selectMaterial, selectedMaterial } from "../../../state/selection";
import { reportErrors, showNote, showError } from "../../../ui/toasts";
import { uploadImage } from "../../../session/net/upload";
import type { ImageBody } from "../../../protocol";
import { loadImages, assignRoughnessAndMetalness, assignMetalness, assignNormals, assignRoughness, assignSet, imageUploadProgress, uploadAndAssign, type AssignImage } from "./imageStore";
import { isColorName, detectMap } from "./mapNames";
import { planSet, setName, setMessage, type Slot } from "./textureSet";

export const IMAGE_TYPES = ["image/png", "image/jpeg", "image/webp"];

/** The drop target of files: a material, and its map if that is known. */
export interface DropTarget {
  material: Promise<string | null>;
  assign: AssignImage | undefined;
}

let dropTarget: DropTarget | null = null;

/** Files were dropped on a material, which is known now or soon; on the field of `assign`, or anywhere on it. */
export function onDrop(material: Promise<string | null>, assign?: AssignImage): void {
  dropTarget = { material, assign };
}

/** The target of the files that are dropped now; null if that is no material. */
export function consumeDropTarget(): DropTarget | null {
  const target = dropTarget;
  dropTarget = null;
  return target;
}

/** Whether a file is an image that a material can show. An EXR is one where its name says what it is a map of. */
export function isTextureFile(file: File): boolean {
  const isExr = file.name.toLowerCase().endsWith(".exr");
  return IMAGE_TYPES.includes(file.type) || (isExr && (detectMap(file.name) !== null || isColorName(file.name)));
}

/** How each kind of map is assigned, and its label. */
const ASSIGNMENTS: Record<string, { assign: AssignImage; as: string }> = {
  roughness: { assign: assignRoughness, as: "as roughness" },
  metal: { assign: assignMetalness, as: "as metalness" },
  normals: { assign: assignNormals, as: "as normals" },
  "roughness and metal": { assign: assignRoughnessAndMetalness, as: "as roughness by its green and as metalness by its blue" },
};

/** Why a kind of map is not supported. */
const UNSUPPORTED_MAPS: Record<string, string> = {
  gloss: "Turn it round into one of roughness, and drop that.",
  heights: "Drop the normal map that was made of it.",
  "normals for DirectX": "Its green points down: drop the one for OpenGL, as glTF has it.",
  occlusion: "What hides light is traced here.",
  "what shines": "Light is part of a bake: import the scene with it, and bake again.",
  opacity: "What is cut out comes with the scene.",
  reflectance: "Set it with f0.",
};

/** Upload the images of a set sequentially; returns the uploaded ones, and rejects the others with the reason. */
async function uploadSet(slots: ReadonlyMap<Slot, File>, reject: (name: string, reason: string) => void) {
  const files = [...new Set(slots.values())];
  const uploaded = new Map<File, ImageBody>();
  for (const [k, file] of files.entries()) {
    const progressLabel = `${k + 1} of ${files.length}: ${file.name}`;
    const onProgress = (fraction: number) =>
      (imageUploadProgress.value = fraction < 1 ? `Sending ${progressLabel}, ${Math.round(100 * fraction)} %` : `Reading ${progressLabel}…`);
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
  if (imageUploadProgress.value !== null) return showNote("Images are on their way already; drop these when they are there.");
  const { slots, rejected } = planSet(files, isTextureFile);
  selectMaterial(material); // its inspector says how far the images are
  try {
    const uploaded = await uploadSet(slots, (name, reason) => rejected.push({ name, reason }));
    await loadImages();
    const set = new Map([...slots].flatMap(([slot, file]) => (uploaded.has(file) ? [[slot, uploaded.get(file) as ImageBody]] : [])));
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

/** Apply one image: to the map that its name says, else as the base color. */
async function applyFile(material: string, file: File): Promise<void> {
  const map = detectMap(file.name);
  if (map === null) return uploadAndAssign(material, file);
  const useAsColor = { label: "Use as colour", run: () => void uploadAndAssign(material, file) };
  const assignment = ASSIGNMENTS[map];
  if (assignment !== undefined) {
    showNote(`“${file.name}” is shown ${assignment.as}.`, useAsColor);
    return uploadAndAssign(material, file, assignment.assign);
  }
  showNote(`“${file.name}” looks like a map of ${map}. ${UNSUPPORTED_MAPS[map] ?? ""}`, useAsColor);
}

/** Apply images dropped on the page: to the drop target, else to the selection. */
export async function applyImageFiles(files: readonly File[], target: DropTarget | null): Promise<void> {
  const material = (await reportErrors(async () => target?.material)) ?? selectedMaterial.value;
  const [first] = files;
  if (first === undefined) return;
  if (material === null) return showNote("Drop the image on an object, or choose a material first; it takes what comes next.");
  if (files.length > 1) return applySet(material, files);
  await (target?.assign === undefined ? applyFile(material, first) : uploadAndAssign(material, first, target.assign));
}
