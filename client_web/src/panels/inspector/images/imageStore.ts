/** Uploaded images: listing, uploading, and assigning them to materials. */
import { computed, signal } from "@preact/signals";
import { isImageReference } from "../../../state/document/imageReference";
import { jsonPointer } from "../../../state/document/pointer";
import { editValue, replaceLook } from "../../../edit/edit";
import { history } from "../../../edit/history";
import { deleteImage, listImages, addMetalness } from "../../../session/net/api";
import { uploadImage } from "../../../session/net/upload";
import type { ImageBody, MaterialLook, Term } from "../../../protocol";
import { MAX_LIGHTS } from "../../../look.gen";
import { defaultLook, look } from "../../../state/look";
import { scene } from "../../../state/scene";
import { selectMaterial } from "../../../state/selection";
import { reportErrors, showNote, showWarnings } from "../../../ui/toasts";
import { baseTexture, hasBaseColor, withBaseImage, withoutBaseImage } from "./baseColor";
import { emittingLight, lightWithoutImage, meshLightOf } from "./emission";
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

/** Images uploaded by users, without generated ones. */
export const uploadedImages = computed(() => images.value.filter(({ metalness }) => metalness === null));

const NO_COLOR = "This material has no base color. Add a diffuse or a GGX layer to use a base color texture.";
const TOO_MANY_LIGHTS = `Limit of ${MAX_LIGHTS} lights reached. Remove one before a material emits an image.`;
const NO_METAL = "Needs a diffuse layer and a GGX layer to use a metalness map.";

/** Assigns an image to a material map. */
export type AssignImage = (material: string, image: ImageBody) => void | Promise<void>;

/** Edits a material's terms; `own`: the scene's original terms. */
type MakeTerms = (terms: readonly Term[], own: readonly Term[]) => Term[];

export const imageOf = (texture: string): ImageBody | undefined =>
  images.value.find((image) => image.texture === texture);

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

/** Change a material's terms and apply a metalness map: the server generates the images that the terms refer to. */
async function applyMetalness(label: string, material: string, image: ImageBody, make: MakeTerms): Promise<void> {
  const terms = termsOf(material);
  const sceneId = scene.value?.id;
  if (terms === undefined || sceneId === undefined) return;
  const metalTerms = await reportErrors(() =>
    addMetalness(image.id, sceneId, material, make(terms, ownTerms(material))),
  );
  if (metalTerms === undefined) return;
  await loadImages(); // lists generated images before the look refers to them
  if (termsOf(material) !== terms) return showNote("The material changed in the meantime. Apply the image again.");
  replaceTerms(label, material, () => metalTerms);
}

/** The metalness map that stays on a material whose base color changes. */
function metalnessImageOf(material: string): ImageBody | undefined {
  const name = metalnessOf(termsOf(material) ?? [], imageOf);
  return name === null ? undefined : imageOf(name);
}

/** Change the base color, below the metalness map if there is one. */
function replaceBase(label: string, material: string, make: MakeTerms): void | Promise<void> {
  const metal = metalnessImageOf(material);
  if (metal === undefined) return replaceTerms(label, material, make);
  return applyMetalness(label, material, metal, (terms, originals) =>
    make(withoutMetalness(terms, originals, imageOf), originals),
  );
}

/** The current base-color texture, also below a metalness map. */
export function baseOf(terms: readonly Term[]): string | null {
  const textureName = baseTexture(terms);
  const image = isImageReference(textureName) ? imageOf(textureName) : undefined;
  return image !== undefined && image.metalness !== null ? image.base : textureName;
}

/** Set an image as the base color of a material. */
export async function assignImage(material: string, { texture, name }: ImageBody): Promise<void> {
  if (!hasBaseColor(termsOf(material) ?? [])) return showNote(NO_COLOR);
  selectMaterial(material);
  await replaceBase(`Base color · ${name}`, material, (terms) => withBaseImage(terms, texture));
}

/** Set a material's metalness map; `make` changes the material in the same step. */
export async function assignMetalness(
  material: string,
  image: ImageBody,
  make: MakeTerms = (terms) => [...terms],
): Promise<void> {
  if (!canBeMetal(termsOf(material) ?? [])) return showNote(NO_METAL);
  selectMaterial(material);
  await applyMetalness(`Metalness · ${image.name}`, material, image, make);
}

/** Remove the metalness map and restore the original metalness. */
export function removeMetalnessMap(material: string): void {
  replaceTerms("Remove metalness map", material, (terms, originals) => withoutMetalness(terms, originals, imageOf));
}

/** Set the roughness map of a term and the terms that share it, or of the whole material. */
export function assignRoughness(material: string, image: ImageBody, index: number | null = null): void {
  const indices = (terms: readonly Term[]) => (index === null ? roughTermIndices(terms) : [index]);
  if (indices(termsOf(material) ?? []).length === 0) return showNote("No layer of this material has a roughness.");
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

/** Make a material emit an image. */
export function assignEmission(material: string, { texture, name }: ImageBody): void {
  const emitter = emittingLight(look.value?.lights ?? {}, material, texture);
  if (emitter === null) return showNote(TOO_MANY_LIGHTS);
  history.endGesture();
  editValue(`Emission · ${name}`, jsonPointer("lights", emitter.name), emitter.light);
  selectMaterial(material);
}

/** Restore the original emission. */
export function removeEmissionImage(material: string): void {
  const emitter = meshLightOf(look.value?.lights ?? {}, material);
  if (emitter === null) return;
  history.endGesture();
  const next = lightWithoutImage(emitter, defaultLook.value?.lights ?? {});
  editValue("Remove emission map", jsonPointer("lights", emitter.name), next);
}

/** Restore the original normal map. */
export function removeNormalMap(material: string): void {
  replaceMaterial("Remove normal map", material, (current) =>
    withoutNormals(current, defaultLook.value?.materials[material]),
  );
}

/** Set an image as roughness and metalness map, packed as in glTF: roughness in green, metalness in blue. */
export function assignRoughnessAndMetalness(material: string, image: ImageBody): void | Promise<void> {
  if (!canBeMetal(termsOf(material) ?? [])) {
    showNote(NO_METAL);
    return assignRoughness(material, image);
  }
  return assignMetalness(material, image, (terms) => withRoughnessImage(terms, roughTermIndices(terms), image));
}

/** Restore the original roughness. */
export function removeRoughnessMap(material: string): void {
  replaceMaterial("Remove roughness map", material, (current) => {
    const bare = { ...current, terms: withoutRoughnessImage(current.terms, ownTerms(material)) };
    return current.normal_map == null ? bare : withNormals(bare, current.normal_map.image); // which finer normals widen
  });
}

/** Restore the original base color. */
export async function unassign(material: string): Promise<void> {
  await replaceBase("Remove base color texture", material, withoutBaseImage);
}

/** Assign the images of a set to a material, in one step; returns the rejected ones with reasons. */
export async function assignSet(
  label: string,
  material: string,
  set: Map<Slot, ImageBody>,
): Promise<Map<Slot, string>> {
  const rejections = new Map<Slot, string>();
  const current = look.value?.materials[material];
  const sceneId = scene.value?.id;
  if (current === undefined || sceneId === undefined) return rejections;
  const reject = (slot: Slot, reason: string) => set.delete(slot) && rejections.set(slot, reason);
  if (!hasBaseColor(current.terms)) reject("base color", "the material has none");
  if (roughTermIndices(current.terms).length === 0) reject("roughness", "the material has none");
  if (!canBeMetal(current.terms)) reject("metalness", "needs a diffuse layer and a GGX layer");
  const emissionImage = set.get("emission");
  if (emissionImage !== undefined && emittingLight(look.value?.lights ?? {}, material, "") === null)
    reject("emission", "there are too many lights");
  const metal = set.get("metalness") ?? (set.has("base color") ? metalnessImageOf(material) : undefined);
  const bare = set.has("base color") ? withoutMetalness(current.terms, ownTerms(material), imageOf) : current.terms;
  let terms = withColorAndRoughness(bare, set);
  if (metal !== undefined) terms = await addMetalness(metal.id, sceneId, material, terms);
  await loadImages(); // lists generated images before the look refers to them
  if (look.value?.materials[material] !== current)
    throw new Error("The material changed in the meantime. Drop the images again.");
  if (set.size === 0) return rejections;
  const materials = { ...look.value.materials, [material]: withSet(current, terms, set) };
  const emitter =
    emissionImage === undefined ? null : emittingLight(look.value.lights, material, emissionImage.texture);
  const lights = emitter === null ? look.value.lights : { ...look.value.lights, [emitter.name]: emitter.light };
  history.endGesture();
  replaceLook(`${material} · ${label}`, { ...look.value, materials, lights });
  return rejections;
}

/** Upload an image and set it as base color, or as `assign` does. */
export async function uploadAndAssign(material: string, file: File, assign: AssignImage = assignImage): Promise<void> {
  if (imageUploadProgress.value !== null) return showNote("Still uploading; try again in a moment.");
  const onProgress = (fraction: number) =>
    (imageUploadProgress.value =
      fraction < 1 ? `Uploading ${file.name}, ${Math.round(100 * fraction)} %` : `Processing ${file.name}…`);
  onProgress(0);
  const image = await reportErrors(() => uploadImage(file, onProgress), "files");
  imageUploadProgress.value = null;
  if (image === undefined) return;
  await loadImages();
  await assign(material, image);
  showWarnings(image.warnings);
}

/** Delete an image after confirmation; the material gets its original map back. Saved looks keep theirs. */
export function offerToDeleteImage(
  material: string,
  { id, name }: ImageBody,
  off: (material: string) => void | Promise<void>,
): void {
  showNote(`Delete the image “${name}”? You can upload it again later.`, {
    label: "Delete",
    run: () =>
      void reportErrors(async () => {
        await off(material);
        await deleteImage(id);
        await loadImages();
      }),
  });
}
