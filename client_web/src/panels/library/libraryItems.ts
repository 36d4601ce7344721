/** The library: fitted materials, measurements that were imported here, and putting one onto an object. */
import { computed, signal } from "@preact/signals";
import { jsonPointer } from "../../state/document/pointer";
import { editValue } from "../../edit/edit";
import { listBtfs, listMaterials, listMeasured, materialThumbnailUrl } from "../../session/net/api";
import { uploadMeasured } from "../../session/net/upload";
import type { BtfBody, MaterialBody, MeasuredBody, Term } from "../../protocol";
import { libraryOpen } from "../../state/panels";
import { togglePanel } from "../../state/panelWidths";
import { selectMaterial, selectedMaterial, selectedTerm, selectTerm } from "../../state/selection";
import { reportErrors, showNote } from "../../ui/toasts";
import { trackJobs, type Geometry, continueJob, importImages, makeFromMesh, generate } from "./btfJobs";

export const DRAG_TYPE = "application/x-relume-material";
/** Among the models: what was measured and is not fitted. */
export const MEASURED = "measured";
/** And textures that look different from every side. */
export const BTFS = "btfs";

/** What a ball of the library stands for. */
interface LibraryEntry {
  id: string;
  name: string;
  description: string;
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
/** The search text: all of its words must occur in an entry's name or description. */
export const query = signal("");
export const group = signal("all");
export const model = signal("cook_torrance");
/** Uploaded fraction of a measurement; null without an upload. */
export const materialUploadProgress = signal<number | null>(null);

const uniqueOf = (values: string[]) => [...new Set(values)].sort();
export const groups = computed(() => uniqueOf(library.value.map((material) => material.group)));
export const fittedModels = computed(() => uniqueOf(library.value.map((material) => material.model)));

function fittedEntry({ id, name, source, terms, model: modelName, group: groupName }: MaterialBody): LibraryEntry {
  return { id, name, description: `${name}. ${source}`, thumbnail: materialThumbnailUrl(id), terms, model: modelName, group: groupName };
}

function measuredEntry({ id, name, thumbnail, terms }: MeasuredBody): LibraryEntry {
  const description = `${name}, measured. Exact until its curves are edited.`;
  return { id, name, description, thumbnail, terms, model: MEASURED, group: null };
}

function btfEntry({ id, name, thumbnail, terms, synthetic, size, error }: BtfBody): LibraryEntry {
  const from = synthetic === null ? "measured" : "synthetic, rendered from a small geometry";
  const missed = (100 * (error.at(-1) ?? 0)).toFixed(1);
  const description = `${name}, ${from}. ${size[1]}×${size[0]} texels, kept to ${missed} %.`;
  return { id, name, description, thumbnail, terms, model: BTFS, group: null };
}

const entries = computed<LibraryEntry[]>(() => [
  ...library.value.map(fittedEntry),
  ...measured.value.map(measuredEntry),
  ...btfs.value.map(btfEntry),
]);
/** Whether what is shown has kinds: measurements have none. */
export const hasGroups = computed(() => model.value !== MEASURED && model.value !== BTFS);

/** One entry a material and source, of the model and group that are chosen. */
export const visibleEntries = computed<LibraryEntry[]>(() => {
  const isOfGroup = (entry: LibraryEntry) => !hasGroups.value || group.value === "all" || entry.group === group.value;
  return entries.value.filter((entry) => entry.model === model.value && isOfGroup(entry) && matchesSearch(entry, query.value));
});

const MAX_OTHER_GROUPS = 4;

/** Where nothing that is shown is called as was typed: the models that have something, and how much. */
export const otherGroupMatches = computed<[model: string, num: number][]>(() => {
  if (query.value.trim() === "" || visibleEntries.value.length > 0) return [];
  const counts = new Map<string, number>();
  for (const entry of entries.value)
    if (matchesSearch(entry, query.value)) counts.set(entry.model, 1 + (counts.get(entry.model) ?? 0));
  return [...counts].sort((left, right) => right[1] - left[1]).slice(0, MAX_OTHER_GROUPS);
});

export function showGroup(groupName: string): void {
  [model.value, group.value] = [groupName, "all"];
}

export function matchesSearch({ name, description }: Pick<LibraryEntry, "name" | "description">, typed: string): boolean {
  const text = `${name} ${description}`.toLowerCase().replaceAll("-", " ");
  return typed.toLowerCase().replaceAll("-", " ").split(/\s+/).every((word) => text.includes(word));
}

export async function openLibrary(): Promise<void> {
  togglePanel("library");
  await reportErrors(async () => {
    await refreshBtfs(); // commands make them meanwhile
    if (library.value.length === 0) [library.value, measured.value] = await Promise.all([listMaterials(), listMeasured()]);
    if (libraryOpen.value) await trackJobs(refreshBtfs);
  });
}

async function refreshBtfs(): Promise<void> {
  btfs.value = await listBtfs();
}

/** Begin something that is made on the server, show it, and follow it. */
async function startJob(work: () => Promise<void>): Promise<void> {
  await reportErrors(async () => {
    model.value = BTFS;
    await work();
    await trackJobs(refreshBtfs);
  }, "files");
}

export const generateBtf = (geometry: Geometry) => startJob(() => generate(geometry));
export const makeBtfOfMesh = (file: File, period: number | null) => startJob(() => makeFromMesh(file, period));
export const resumeJob = (id: string) => startJob(() => continueJob(id));

const BTF_SUFFIXES = [".zip", ".btf"];

/** A zip of images or a container is a texture from all sides, anything else a MERL file. */
export async function importMaterial(file: File): Promise<void> {
  if (BTF_SUFFIXES.some((suffix) => file.name.toLowerCase().endsWith(suffix))) await startJob(() => importImages(file));
  else await importMeasured(file);
}

/** Import several, one after another, in the open library. */
export async function importMaterials(files: readonly File[]): Promise<void> {
  if (!libraryOpen.value) await openLibrary();
  for (const file of files) await importMaterial(file);
}

/** Import a MERL file and show it among the measurements. */
async function importMeasured(file: File): Promise<void> {
  await reportErrors(async () => {
    materialUploadProgress.value = 0;
    try {
      const material = await uploadMeasured(file, (fraction) => (materialUploadProgress.value = fraction));
      measured.value = await listMeasured();
      model.value = MEASURED;
      showNote(`${material.name} is in the library.`);
    } finally {
      materialUploadProgress.value = null;
    }
  }, "files");
}

/** Give an object the terms of another material. A material is what it looks like: the object's images do not come
 * along, the texture switch of each term brings one back. */
export function applyTerms(target: string, label: string, terms: readonly Term[]): void {
  const bare = terms.map((term) => ({ ...term, texture: null }));
  editValue(label, jsonPointer("materials", target, "terms"), bare);
}

export function applyEntry(target: string, id: string): void {
  const entry = entries.value.find((candidate) => candidate.id === id);
  if (entry === undefined) return;
  applyTerms(target, entry.name, entry.terms);
  selectMaterial(target);
  if (selectedTerm.value >= entry.terms.length) selectTerm(0); // the open term was replaced
}

export function applyToSelected(id: string): void {
  if (selectedMaterial.value === null) showNote("Choose a material of the scene first; it takes what you pick here.");
  else applyEntry(selectedMaterial.value, id);
}
