/** Images that were sent: the list, sending one, and putting one onto a material. */
import { computed, signal } from "@preact/signals";
import { isImage } from "../document/texture";
import { pointer } from "../document/pointer";
import { edit } from "../edit/edit";
import { history } from "../edit/history";
import { deleteImage, listImages, withMetalness } from "../net/api";
import { uploadImage } from "../net/upload";
import type { ImageBody, MaterialLook, Term } from "../protocol";
import { defaultLook, look } from "../state/look";
import { scene } from "../state/scene";
import { select } from "../state/selection";
import { attempt, note } from "../ui/toasts";
import { baseTexture, hasBaseColor, withBaseImage, withoutBaseImage } from "./colour";
import { mayBeMetal, metalnessOf, withoutMetalness } from "./metalness";
import { withNormals, withoutNormals } from "./normals";
import { withColorAndRoughness, withSet, type Slot } from "./textureSet";
import { roughPlaces, withoutRoughnessImage, withRoughnessImage } from "./roughness";

/** Null until the server has listed them. */
const listed = signal<readonly ImageBody[] | null>(null);
export const images = computed(() => listed.value ?? []);
export const areListed = computed(() => listed.value !== null);
/** What is on its way, in words. */
export const sending = signal<string | null>(null);

/** Those that people sent: others were made of them. */
export const sentImages = computed(() => images.value.filter(({ metalness }) => metalness === null));

const NO_COLOR = "Nothing of this material shows a base color: it needs a term that scatters light, or a highlight.";
const NO_METAL = "This material cannot become metal: it needs a term that scatters light, and a highlight with f0, such as GGX.";

/** Puts an image onto a material, in some place. */
export type Put = (material: string, image: ImageBody) => void | Promise<void>;

/** What becomes of a material's terms; `own`: those of the scene. */
type Make = (terms: readonly Term[], own: readonly Term[]) => Term[];

export const imageOf = (texture: string): ImageBody | undefined => images.value.find((image) => image.texture === texture);

export async function loadImages(): Promise<void> {
  await attempt(async () => {
    listed.value = await listImages();
  });
}

const termsOf = (material: string) => look.value?.materials[material]?.terms;
const ownTerms = (material: string): readonly Term[] => defaultLook.value?.materials[material]?.terms ?? [];

function replaceTerms(label: string, material: string, make: Make): void {
  const terms = termsOf(material);
  if (terms === undefined) return;
  history.seal();
  edit(label, pointer("materials", material, "terms"), make(terms, ownTerms(material)));
}

/** Change a material's terms, and let an image say where they are metal: the server makes of it what the terms name. */
async function makeMetal(label: string, material: string, image: ImageBody, make: Make): Promise<void> {
  const terms = termsOf(material);
  const of = scene.value?.id;
  if (terms === undefined || of === undefined) return;
  const made = await attempt(() => withMetalness(image.id, of, material, make(terms, ownTerms(material))));
  if (made === undefined) return;
  await loadImages(); // those that were made are known before the look names them
  if (termsOf(material) !== terms) return note("The material was changed meanwhile; put the image on it again.");
  replaceTerms(label, material, () => made);
}

/** The image of metalness that stays on a material whose base colour changes. */
function metalOn(material: string): ImageBody | undefined {
  const name = metalnessOf(termsOf(material) ?? [], imageOf);
  return name === null ? undefined : imageOf(name);
}

/** Change the base colour, which lies under metalness where an image says that. */
function replaceBase(label: string, material: string, make: Make): void | Promise<void> {
  const metal = metalOn(material);
  if (metal === undefined) return replaceTerms(label, material, make);
  return makeMetal(label, material, metal, (terms, own) => make(withoutMetalness(terms, own, imageOf), own));
}

/** The texture of the base colour as it is, under metalness too. */
export function baseOf(terms: readonly Term[]): string | null {
  const shown = baseTexture(terms);
  const image = isImage(shown) ? imageOf(shown) : undefined;
  return image !== undefined && image.metalness !== null ? image.base : shown;
}

/** Show an image as the base colour of a material. */
export async function putImage(material: string, { texture, name }: ImageBody): Promise<void> {
  if (!hasBaseColor(termsOf(material) ?? [])) return note(NO_COLOR);
  select(material);
  await replaceBase(`Image · ${name}`, material, (terms) => withBaseImage(terms, texture));
}

/** Let an image say where a material is metal; `make` changes the material in the same step. */
export async function putMetalness(material: string, image: ImageBody, make: Make = (terms) => [...terms]): Promise<void> {
  if (!mayBeMetal(termsOf(material) ?? [])) return note(NO_METAL);
  select(material);
  await makeMetal(`Metalness · ${image.name}`, material, image, make);
}

/** The material is metal where the scene's own is again. */
export function takeMetalnessOff(material: string): void {
  replaceTerms("Metalness image off", material, (terms, own) => withoutMetalness(terms, own, imageOf));
}

/** Show an image as the roughness of a material: of a term and those that follow a map with it, or of the whole. */
export function putRoughness(material: string, image: ImageBody, index: number | null = null): void {
  const places = (terms: readonly Term[]) => (index === null ? roughPlaces(terms) : [index]);
  if (places(termsOf(material) ?? []).length === 0) return note("Nothing of this material has a roughness.");
  replaceTerms(`Roughness · ${image.name}`, material, (terms) => withRoughnessImage(terms, places(terms), image));
  select(material);
}

function replaceMaterial(label: string, material: string, make: (of: MaterialLook) => MaterialLook): void {
  const of = look.value?.materials[material];
  if (of === undefined) return;
  history.seal();
  edit(label, pointer("materials", material), make(of));
}

/** Let an image say how a material's surfaces lean. */
export function putNormals(material: string, { texture, name }: ImageBody): void {
  replaceMaterial(`Normals · ${name}`, material, (of) => withNormals(of, texture));
  select(material);
}

/** The material has the bumps of the scene again. */
export function takeNormalsOff(material: string): void {
  replaceMaterial("Normal image off", material, (of) => withoutNormals(of, defaultLook.value?.materials[material]));
}

/** Show an image as both, as files of glTF pack them: green is roughness, blue is metalness. */
export function putBoth(material: string, image: ImageBody): void | Promise<void> {
  if (!mayBeMetal(termsOf(material) ?? [])) {
    note(NO_METAL);
    return putRoughness(material, image);
  }
  return putMetalness(material, image, (terms) => withRoughnessImage(terms, roughPlaces(terms), image));
}

/** The material is as rough as the scene's own again. */
export function takeRoughnessOff(material: string): void {
  replaceMaterial("Roughness image off", material, (of) => {
    const bare = { ...of, terms: withoutRoughnessImage(of.terms, ownTerms(material)) };
    return of.normal_map == null ? bare : withNormals(bare, of.normal_map.image); // which bumps widen
  });
}

/** The material shows its own colours again. */
export async function takeOff(material: string): Promise<void> {
  await replaceBase("Image off", material, withoutBaseImage);
}

/** Put the images of a set onto a material, in one step; gives those that have no place, with the reason. */
export async function putSet(label: string, material: string, set: Map<Slot, ImageBody>): Promise<Map<Slot, string>> {
  const refused = new Map<Slot, string>();
  const of = look.value?.materials[material];
  const sceneId = scene.value?.id;
  if (of === undefined || sceneId === undefined) return refused;
  const refuse = (slot: Slot, reason: string) => set.delete(slot) && refused.set(slot, reason);
  if (!hasBaseColor(of.terms)) refuse("base color", "nothing of the material shows one");
  if (roughPlaces(of.terms).length === 0) refuse("roughness", "nothing of the material has one");
  if (!mayBeMetal(of.terms)) refuse("metalness", "the material needs a term that scatters light, and a highlight with f0");
  const metal = set.get("metalness") ?? (set.has("base color") ? metalOn(material) : undefined);
  const bare = set.has("base color") ? withoutMetalness(of.terms, ownTerms(material), imageOf) : of.terms;
  let terms = withColorAndRoughness(bare, set);
  if (metal !== undefined) terms = await withMetalness(metal.id, sceneId, material, terms);
  await loadImages(); // those that were made are known before the look names them
  if (look.value?.materials[material] !== of) throw new Error("The material was changed meanwhile; drop the images on it again.");
  if (set.size > 0) replaceMaterial(label, material, () => withSet(of, terms, set));
  return refused;
}

/** Send an image, and show it as the base colour of a material, or where `put` puts it. */
export async function sendOnto(material: string, file: File, put: Put = putImage): Promise<void> {
  if (sending.value !== null) return note("One image is on its way already; give the next one when it is there.");
  const tell = (share: number) =>
    (sending.value = share < 1 ? `Sending ${file.name}, ${Math.round(100 * share)} %` : `Reading ${file.name}…`);
  tell(0);
  const image = await attempt(() => uploadImage(file, tell), "files");
  sending.value = null;
  if (image === undefined) return;
  await loadImages();
  await put(material, image);
  for (const warning of image.warnings) note(warning);
}

/** Delete an image once that was confirmed; the material shows its own again. What saved looks show stays. */
export function offerToDelete(material: string, { id, name }: ImageBody, off: (material: string) => void | Promise<void>): void {
  note(`Delete the image “${name}”? It can be sent again.`, {
    label: "Delete",
    run: () =>
      void attempt(async () => {
        await off(material);
        await deleteImage(id);
        await loadImages();
      }),
  });
}
