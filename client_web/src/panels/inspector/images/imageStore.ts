/** Images that were sent: the list, sending one, and putting one onto a material. */
import { computed, signal } from "@preact/signals";
import { isImageReference } from "../../../state/document/imageReference";
import { jsonPointer } from "../../../state/document/pointer";
import { editValue } from "../../../edit/edit";
import { history } from "../../../edit/history";
import { deleteImage, listImages, addMetalness } from "../../../session/net/api";
import { uploadImage } from "../../../session/net/upload";
import type { ImageBody, MaterialLook, Term } from "../../../protocol";
import { defaultLook, look } from "../../../state/look";
import { scene } from "../../../state/scene";
import { selectMaterial } from "../../../state/selection";
import { reportErrors, showNote } from "../../../ui/toasts";
import { baseTexture, hasBaseColor, withBaseImage, withoutBaseImage } from "./baseColor";
import { canBeMetal, metalnessOf, withoutMetalness } from "./metalness";
import { withNormals, withoutNormals } from "./normals";
import { withColorAndRoughness, withSet, type Slot } from "./textureSet";
import { roughTermIndices, withoutRoughnessImage, withRoughnessImage } from "./roughness";

/** Null until the server has listed them. */
const imageList = signal<readonly ImageBody[] | null>(null);
export const images = computed(() => imageList.value ?? []);
export const areListed = computed(() => imageList.value !== null);
/** Progress text of the current upload. */
export const imageUploadProgress = signal<string | null>(null);

/** Images that users uploaded: others were made of them. */
export const uploadedImages = computed(() => images.value.filter(({ metalness }) => metalness === null));

const NO_COLOR = "Nothing of this material shows a base color: it needs a term that scatters light, or a highlight.";
const NO_METAL = "This material cannot become metal: it needs a term that scatters light, and a highlight with f0, such as GGX.";

/** Assigns an image to a material map. */
export type AssignImage = (material: string, image: ImageBody) => void | Promise<void>;

/** What becomes of a material's terms; `own`: those of the scene. */
type MakeTerms = (terms: readonly Term[], own: readonly Term[]) => Term[];

export const imageOf = (texture: string): ImageBody | undefined => images.value.find((image) => image.texture === texture);

export async function loadImages(): Promise<void> {
  await reportErrors(async () => {
    imageList.value = await listImages();
  });
}

const termsOf = (material: string) => look.value?.materials[material]?.terms;
const ownTerms = (material: string): readonly Term[] => defaultLook.value?.materials[material]?.terms ?? [];

function replaceTerms(label: string, material: string, make: MakeTerms): void {
  const terms = termsOf(material);
  if (terms === undefined) return;
  history.endGesture();
  editValue(label, jsonPointer("materials", material, "terms"), make(terms, ownTerms(material)));
}

/** Change a material's terms, and let an image say where they are metal: the server makes of it what the terms name. */
async function applyMetalness(label: string, material: string, image: ImageBody, make: MakeTerms): Promise<void> {
  const terms = termsOf(material);
  const sceneId = scene.value?.id;
  if (terms === undefined || sceneId === undefined) return;
  const metalTerms = await reportErrors(() => addMetalness(image.id, sceneId, material, make(terms, ownTerms(material))));
  if (metalTerms === undefined) return;
  await loadImages(); // those that were made are known before the look names them
  if (termsOf(material) !== terms) return showNote("The material was changed meanwhile; put the image on it again.");
  replaceTerms(label, material, () => metalTerms);
}

/** The image of metalness that stays on a material whose base color changes. */
function metalnessImageOf(material: string): ImageBody | undefined {
  const name = metalnessOf(termsOf(material) ?? [], imageOf);
  return name === null ? undefined : imageOf(name);
}

/** Change the base color, which lies under metalness where an image says that. */
function replaceBase(label: string, material: string, make: MakeTerms): void | Promise<void> {
  const metal = metalnessImageOf(material);
  if (metal === undefined) return replaceTerms(label, material, make);
  return applyMetalness(label, material, metal, (terms, originals) => make(withoutMetalness(terms, originals, imageOf), originals));
}

/** The texture of the base color as it is, under metalness too. */
export function baseOf(terms: readonly Term[]): string | null {
  const textureName = baseTexture(terms);
  const image = isImageReference(textureName) ? imageOf(textureName) : undefined;
  return image !== undefined && image.metalness !== null ? image.base : textureName;
}

/** Show an image as the base color of a material. */
export async function assignImage(material: string, { texture, name }: ImageBody): Promise<void> {
  if (!hasBaseColor(termsOf(material) ?? [])) return showNote(NO_COLOR);
  selectMaterial(material);
  await replaceBase(`Image · ${name}`, material, (terms) => withBaseImage(terms, texture));
}

/** Let an image say where a material is metal; `make` changes the material in the same step. */
export async function assignMetalness(material: string, image: ImageBody, make: MakeTerms = (terms) => [...terms]): Promise<void> {
  if (!canBeMetal(termsOf(material) ?? [])) return showNote(NO_METAL);
  selectMaterial(material);
  await applyMetalness(`Metalness · ${image.name}`, material, image, make);
}

/** The material is metal where the scene's own is again. */
export function removeMetalnessMap(material: string): void {
  replaceTerms("Metalness image off", material, (terms, originals) => withoutMetalness(terms, originals, imageOf));
}

/** Show an image as the roughness of a material: of a term and those that follow a map with it, or of the whole. */
export function assignRoughness(material: string, image: ImageBody, index: number | null = null): void {
  const indices = (terms: readonly Term[]) => (index === null ? roughTermIndices(terms) : [index]);
  if (indices(termsOf(material) ?? []).length === 0) return showNote("Nothing of this material has a roughness.");
  replaceTerms(`Roughness · ${image.name}`, material, (terms) => withRoughnessImage(terms, indices(terms), image));
  selectMaterial(material);
}

function replaceMaterial(label: string, material: string, make: (current: MaterialLook) => MaterialLook): void {
  const current = look.value?.materials[material];
  if (current === undefined) return;
  history.endGesture();
  editValue(label, jsonPointer("materials", material), make(current));
}

/** Use an image as a material's normal map. */
export function assignNormals(material: string, { texture, name }: ImageBody): void {
  replaceMaterial(`Normals · ${name}`, material, (current) => withNormals(current, texture));
  selectMaterial(material);
}

/** The material has the bumps of the scene again. */
export function removeNormalMap(material: string): void {
  replaceMaterial("Normal image off", material, (current) => withoutNormals(current, defaultLook.value?.materials[material]));
}

/** Show an image as both, as files of glTF pack them: green is roughness, blue is metalness. */
export function assignRoughnessAndMetalness(material: string, image: ImageBody): void | Promise<void> {
  if (!canBeMetal(termsOf(material) ?? [])) {
    showNote(NO_METAL);
    return assignRoughness(material, image);
  }
  return assignMetalness(material, image, (terms) => withRoughnessImage(terms, roughTermIndices(terms), image));
}

/** The material is as rough as the scene's own again. */
export function removeRoughnessMap(material: string): void {
  replaceMaterial("Roughness image off", material, (current) => {
    const bare = { ...current, terms: withoutRoughnessImage(current.terms, ownTerms(material)) };
    return current.normal_map == null ? bare : withNormals(bare, current.normal_map.image); // which bumps widen
  });
}

/** The material shows its own colors again. */
export async function unassign(material: string): Promise<void> {
  await replaceBase("Image off", material, withoutBaseImage);
}

/** Assign the images of a set to a material, in one step; returns the rejected ones with the reason. */
export async function assignSet(label: string, material: string, set: Map<Slot, ImageBody>): Promise<Map<Slot, string>> {
  const rejections = new Map<Slot, string>();
  const current = look.value?.materials[material];
  const sceneId = scene.value?.id;
  if (current === undefined || sceneId === undefined) return rejections;
  const reject = (slot: Slot, reason: string) => set.delete(slot) && rejections.set(slot, reason);
  if (!hasBaseColor(current.terms)) reject("base color", "nothing of the material shows one");
  if (roughTermIndices(current.terms).length === 0) reject("roughness", "nothing of the material has one");
  if (!canBeMetal(current.terms)) reject("metalness", "the material needs a term that scatters light, and a highlight with f0");
  const metal = set.get("metalness") ?? (set.has("base color") ? metalnessImageOf(material) : undefined);
  const bare = set.has("base color") ? withoutMetalness(current.terms, ownTerms(material), imageOf) : current.terms;
  let terms = withColorAndRoughness(bare, set);
  if (metal !== undefined) terms = await addMetalness(metal.id, sceneId, material, terms);
  await loadImages(); // those that were made are known before the look names them
  if (look.value?.materials[material] !== current) throw new Error("The material was changed meanwhile; drop the images on it again.");
  if (set.size > 0) replaceMaterial(label, material, () => withSet(current, terms, set));
  return rejections;
}

/** Send an image, and show it as the base color of a material, or as `assign` says. */
export async function uploadAndAssign(material: string, file: File, assign: AssignImage = assignImage): Promise<void> {
  if (imageUploadProgress.value !== null) return showNote("One image is on its way already; give the next one when it is there.");
  const onProgress = (fraction: number) =>
    (imageUploadProgress.value = fraction < 1 ? `Sending ${file.name}, ${Math.round(100 * fraction)} %` : `Reading ${file.name}…`);
  onProgress(0);
  const image = await reportErrors(() => uploadImage(file, onProgress), "files");
  imageUploadProgress.value = null;
  if (image === undefined) return;
  await loadImages();
  await assign(material, image);
  for (const warning of image.warnings) showNote(warning);
}

/** Delete an image once that was confirmed; the material shows its own again. What saved looks show stays. */
export function offerToDeleteImage(material: string, { id, name }: ImageBody, off: (material: string) => void | Promise<void>): void {
  showNote(`Delete the image “${name}”? It can be sent again.`, {
    label: "Delete",
    run: () =>
      void reportErrors(async () => {
        await off(material);
        await deleteImage(id);
        await loadImages();
      }),
  });
}
