/** The library: fitted materials, measurements that were imported here, and putting one onto an object. */
import { computed, signal } from "@preact/signals";
import { pointer } from "../document/pointer";
import { edit } from "../edit/edit";
import { listBtfs, listMaterials, listMeasured, materialThumbnail } from "../net/api";
import { uploadMeasured } from "../net/upload";
import type { BtfBody, MaterialBody, MeasuredBody, Term } from "../protocol";
import { libraryOpen } from "../state/panels";
import { togglePanel } from "../state/room";
import { select, selectedMaterial, selectedTerm, selectTerm } from "../state/selection";
import { attempt, note } from "../ui/toasts";
import { followMakings, type Geometry, goOnMaking, importImages, makeOfMesh, makeSynthetic } from "./making";

export const DRAG_TYPE = "application/x-relume-material";
/** Among the models: what was measured and is not fitted. */
export const MEASURED = "measured";
/** And textures that look different from every side. */
export const BTFS = "btfs";

/** What a ball of the library stands for. */
interface Entry {
  id: string;
  name: string;
  about: string;
  thumbnail: string;
  terms: Term[];
  /** Of its fit, `MEASURED` or `BTFS`. */
  model: string;
  /** What it is made of; measurements do not say. */
  group: string | null;
}

export const library = signal<MaterialBody[]>([]);
const measured = signal<MeasuredBody[]>([]);
const btfs = signal<BtfBody[]>([]);
/** What was typed to find a material: all of its words are in what an entry is called, or in where it is from. */
export const query = signal("");
export const group = signal("all");
export const model = signal("cook_torrance");
/** Share of a measurement that has been sent; null while none is on its way. */
export const sending = signal<number | null>(null);

const uniqueOf = (values: string[]) => [...new Set(values)].sort();
export const groups = computed(() => uniqueOf(library.value.map((material) => material.group)));
export const fittedModels = computed(() => uniqueOf(library.value.map((material) => material.model)));

function fittedEntry({ id, name, source, terms, model: of, group: made }: MaterialBody): Entry {
  return { id, name, about: `${name}. ${source}`, thumbnail: materialThumbnail(id), terms, model: of, group: made };
}

function measuredEntry({ id, name, thumbnail, terms }: MeasuredBody): Entry {
  const about = `${name}, measured. Exact until its curves are edited.`;
  return { id, name, about, thumbnail, terms, model: MEASURED, group: null };
}

function btfEntry({ id, name, thumbnail, terms, synthetic, size, error }: BtfBody): Entry {
  const from = synthetic === null ? "measured" : "synthetic, rendered from a small geometry";
  const missed = (100 * (error.at(-1) ?? 0)).toFixed(1);
  const about = `${name}, ${from}. ${size[1]}×${size[0]} texels, kept to ${missed} %.`;
  return { id, name, about, thumbnail, terms, model: BTFS, group: null };
}

const entries = computed<Entry[]>(() => [
  ...library.value.map(fittedEntry),
  ...measured.value.map(measuredEntry),
  ...btfs.value.map(btfEntry),
]);
/** Whether what is shown has kinds: measurements have none. */
export const hasKinds = computed(() => model.value !== MEASURED && model.value !== BTFS);

/** One entry a material and source, of the model and group that are chosen. */
export const shown = computed<Entry[]>(() => {
  const isOfGroup = (entry: Entry) => !hasKinds.value || group.value === "all" || entry.group === group.value;
  return entries.value.filter((entry) => entry.model === model.value && isOfGroup(entry) && isFound(entry, query.value));
});

const MOST_ELSEWHERE = 4;

/** Where nothing that is shown is called as was typed: the models that have something, and how much. */
export const elsewhere = computed<[model: string, num: number][]>(() => {
  if (query.value.trim() === "" || shown.value.length > 0) return [];
  const found = new Map<string, number>();
  for (const entry of entries.value)
    if (isFound(entry, query.value)) found.set(entry.model, 1 + (found.get(entry.model) ?? 0));
  return [...found].sort((one, other) => other[1] - one[1]).slice(0, MOST_ELSEWHERE);
});

export function showAll(of: string): void {
  [model.value, group.value] = [of, "all"];
}

export function isFound({ name, about }: Pick<Entry, "name" | "about">, typed: string): boolean {
  const text = `${name} ${about}`.toLowerCase().replaceAll("-", " ");
  return typed.toLowerCase().replaceAll("-", " ").split(/\s+/).every((word) => text.includes(word));
}

export async function openLibrary(): Promise<void> {
  togglePanel("library");
  await attempt(async () => {
    await refreshBtfs(); // commands make them meanwhile
    if (library.value.length === 0) [library.value, measured.value] = await Promise.all([listMaterials(), listMeasured()]);
    if (libraryOpen.value) await followMakings(refreshBtfs);
  });
}

async function refreshBtfs(): Promise<void> {
  btfs.value = await listBtfs();
}

/** Begin something that is made on the server, show it, and follow it. */
async function begin(work: () => Promise<void>): Promise<void> {
  await attempt(async () => {
    model.value = BTFS;
    await work();
    await followMakings(refreshBtfs);
  }, "files");
}

export const make = (geometry: Geometry) => begin(() => makeSynthetic(geometry));
export const makeOf = (file: File, period: number | null) => begin(() => makeOfMesh(file, period));
export const goOn = (id: string) => begin(() => goOnMaking(id));

const BTF_SUFFIXES = [".zip", ".btf"];

/** A zip of images or a container is a texture from all sides, anything else a MERL file. */
export async function importMaterial(file: File): Promise<void> {
  if (BTF_SUFFIXES.some((suffix) => file.name.toLowerCase().endsWith(suffix))) await begin(() => importImages(file));
  else await importMeasured(file);
}

/** Import several, one after another, in the open library. */
export async function importMaterials(files: readonly File[]): Promise<void> {
  if (!libraryOpen.value) await openLibrary();
  for (const file of files) await importMaterial(file);
}

/** Import a MERL file and show it among the measurements. */
async function importMeasured(file: File): Promise<void> {
  await attempt(async () => {
    sending.value = 0;
    try {
      const made = await uploadMeasured(file, (share) => (sending.value = share));
      measured.value = await listMeasured();
      model.value = MEASURED;
      note(`${made.name} is in the library.`);
    } finally {
      sending.value = null;
    }
  }, "files");
}

/** Give an object the terms of another material. A material is what it looks like: the object's images do not come
 * along, the texture switch of each term brings one back. */
export function giveTerms(target: string, label: string, terms: readonly Term[]): void {
  const bare = terms.map((term) => ({ ...term, texture: null }));
  edit(label, pointer("materials", target, "terms"), bare);
}

export function putOn(target: string, id: string): void {
  const entry = entries.value.find((each) => each.id === id);
  if (entry === undefined) return;
  giveTerms(target, entry.name, entry.terms);
  select(target);
  if (selectedTerm.value >= entry.terms.length) selectTerm(0); // the term that was open is gone
}

export function putOnSelected(id: string): void {
  if (selectedMaterial.value === null) note("Choose a material of the scene first; it takes what you pick here.");
  else putOn(selectedMaterial.value, id);
}
