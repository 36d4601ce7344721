/** The library: fitted materials, imported measurements and BTFs, and applying one to an object. */
import { computed, signal } from "@preact/signals";
import { jsonPointer } from "../../state/document/pointer";
import { editValue, replaceLook } from "../../edit/edit";
import { listBtfs, listImported, listMaterials, listMeasured, materialThumbnailUrl } from "../../session/net/api";
import { uploadMaterials, uploadMeasured } from "../../session/net/upload";
import type { BtfBody, ImportedBody, LibraryMaterialBody, MaterialBody, MeasuredBody, Term } from "../../protocol";
import { MATERIALX_SUFFIX } from "../../start/files/sceneFiles";
import { withGlassOf } from "../inspector/glass/glass";
import { look } from "../../state/look";
import { libraryOpen } from "../../state/panels";
import { togglePanel } from "../../state/panelWidths";
import { selectMaterial, selectedMaterial, selectedTerm, selectTerm } from "../../state/selection";
import { formatBytes } from "../../ui/scale";
import { reportErrors, showNote } from "../../ui/toasts";
import { trackJobs, type Geometry, continueJob, importImages, makeFromMesh, generate } from "./btfJobs";

export const DRAG_TYPE = "application/x-relume-material";
/** Entry of the model filter for imported measurements. */
export const MEASURED = "measured";
/** Entry of the model filter for imported materials. */
export const IMPORTED = "imported";
/** Entry of the model filter for BTFs. */
export const BTFS = "btfs";

/** A material of the library, shown as a ball. */
interface LibraryEntry {
  id: string;
  name: string;
  description: string;
  thumbnail: string;
  terms: Term[];
  /** The material with its textures, if it was imported. */
  imported?: LibraryMaterialBody;
  /** Model of the fit, `IMPORTED`, `MEASURED` or `BTFS`. */
  model: string;
  /** Category such as metal; unknown for measurements. */
  group: string | null;
}

export const library = signal<MaterialBody[]>([]);
const measured = signal<MeasuredBody[]>([]);
const imported = signal<ImportedBody[]>([]);
const btfs = signal<BtfBody[]>([]);
/** The search text: all its words must occur in an entry's name or description. */
export const query = signal("");
export const group = signal("all");
export const model = signal("cook_torrance");
/** Uploaded fraction of a measurement; null without an upload. */
export const materialUploadProgress = signal<number | null>(null);

const uniqueOf = (values: string[]) => [...new Set(values)].sort();
export const groups = computed(() => uniqueOf(library.value.map((material) => material.group)));
export const fittedModels = computed(() => uniqueOf(library.value.map((material) => material.model)));

function fittedEntry({ id, name, source, terms, model: modelName, group: groupName }: MaterialBody): LibraryEntry {
  return {
    id,
    name,
    description: `${name}. ${source}`,
    thumbnail: materialThumbnailUrl(id),
    terms,
    model: modelName,
    group: groupName,
  };
}

function measuredEntry({ id, name, thumbnail, terms, warnings }: MeasuredBody): LibraryEntry {
  const exact = `${name}, measured. Exact until you edit its curves.`;
  const description = [exact, ...warnings.map((warning) => `Note: ${warning}.`)].join(" ");
  return { id, name, description, thumbnail, terms, model: MEASURED, group: null };
}

function importedEntries({ id, name: file, materials, warnings }: ImportedBody): LibraryEntry[] {
  const notes = warnings.map(({ text }) => ` Note: ${text}`).join("");
  return materials.map((material, index) => ({
    id: `${id}/${index}`,
    name: material.name,
    description: `${material.name} of ${file}.${notes}`,
    thumbnail: material.thumbnail,
    terms: material.terms,
    imported: material,
    model: IMPORTED,
    group: null,
  }));
}

function btfEntry({ id, name, thumbnail, terms, synthetic, size, error, memory_bytes }: BtfBody): LibraryEntry {
  const from = synthetic === null ? "measured" : "synthetic, rendered from geometry";
  const missed = (100 * (error.at(-1) ?? 0)).toFixed(1);
  const cost = `${formatBytes(memory_bytes)} of memory while it is used`;
  const description = `${name}, ${from}. ${size[1]}×${size[0]} texels, compression error ${missed} %, ${cost}.`;
  return { id, name, description, thumbnail, terms, model: BTFS, group: null };
}

const entries = computed<LibraryEntry[]>(() => [
  ...library.value.map(fittedEntry),
  ...imported.value.flatMap(importedEntries),
  ...measured.value.map(measuredEntry),
  ...btfs.value.map(btfEntry),
]);
/** True if the listed entries have categories; only fitted materials do. */
export const hasGroups = computed(() => ![IMPORTED, MEASURED, BTFS].includes(model.value));

/** Entries of the selected model and category, one per material and source. */
export const visibleEntries = computed<LibraryEntry[]>(() => {
  const isOfGroup = (entry: LibraryEntry) => !hasGroups.value || group.value === "all" || entry.group === group.value;
  return entries.value.filter(
    (entry) => entry.model === model.value && isOfGroup(entry) && matchesSearch(entry, query.value),
  );
});

const MAX_OTHER_GROUPS = 4;

/** If no listed entry matches the search: the other models with matches, and their number. */
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

export function matchesSearch(
  { name, description }: Pick<LibraryEntry, "name" | "description">,
  typed: string,
): boolean {
  const text = `${name} ${description}`.toLowerCase().replaceAll("-", " ");
  return typed
    .toLowerCase()
    .replaceAll("-", " ")
    .split(/\s+/)
    .every((word) => text.includes(word));
}

export async function openLibrary(): Promise<void> {
  togglePanel("library");
  await reportErrors(async () => {
    await refreshBtfs(); // the command line may have created some
    if (library.value.length === 0)
      [library.value, measured.value, imported.value] = await Promise.all([
        listMaterials(),
        listMeasured(),
        listImported(),
      ]);
    if (libraryOpen.value) await trackJobs(refreshBtfs);
  });
}

async function refreshBtfs(): Promise<void> {
  btfs.value = await listBtfs();
}

/** Start a job on the server, show it, and poll it. */
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

/** A ZIP lists its files at its end. */
const ZIP_TAIL_BYTES = 1 << 20;

async function isMaterialX(file: File): Promise<boolean> {
  const name = file.name.toLowerCase();
  if (!name.endsWith(".zip")) return name.endsWith(MATERIALX_SUFFIX);
  return (await file.slice(-ZIP_TAIL_BYTES).text()).toLowerCase().includes(MATERIALX_SUFFIX);
}

/** A .mtlx file or a ZIP with one is MaterialX; a ZIP of images or a .btf file is a BTF, anything else a BRDF. */
export async function importMaterial(file: File): Promise<void> {
  if (await isMaterialX(file)) await importDocument(file);
  else if (BTF_SUFFIXES.some((suffix) => file.name.toLowerCase().endsWith(suffix)))
    await startJob(() => importImages(file));
  else await importMeasured(file);
}

/** Import several files sequentially, with the library open. */
export async function importMaterials(files: readonly File[]): Promise<void> {
  if (!libraryOpen.value) await openLibrary();
  for (const file of files) await importMaterial(file);
}

/** Import a measured BRDF and list it among the measurements. */
const importMeasured = (file: File) =>
  upload(async (progress) => {
    const { name, warnings } = await uploadMeasured(file, progress);
    measured.value = await listMeasured();
    model.value = MEASURED;
    return [name, ...warnings];
  });

/** Import a MaterialX document and list its materials. */
const importDocument = (file: File) =>
  upload(async (progress) => {
    const { name, warnings } = await uploadMaterials(file, progress);
    imported.value = await listImported();
    model.value = IMPORTED;
    return [name, ...warnings.map(({ text }) => text)];
  });

/** Show the progress of an upload, then the material's name and its warnings. */
async function upload(work: (progress: (fraction: number) => void) => Promise<string[]>): Promise<void> {
  await reportErrors(async () => {
    materialUploadProgress.value = 0;
    try {
      const [name, ...warnings] = await work((fraction) => (materialUploadProgress.value = fraction));
      showNote([`“${name}” added to the library.`, ...warnings].join(" Note: "));
    } finally {
      materialUploadProgress.value = null;
    }
  }, "files");
}

/** Replace an object's terms by a library material's. Its textures are dropped; the Texture list of each term restores
 * one. */
export function applyTerms(target: string, label: string, terms: readonly Term[]): void {
  const bare = terms.map((term) => ({ ...term, texture: null }));
  editValue(label, jsonPointer("materials", target, "terms"), bare);
}

/** Replace an object's material by an imported one, with its textures; only objects of glass get its glass. */
export function applyImported(target: string, { name, terms, normal_map, glass }: LibraryMaterialBody): void {
  const current = look.value?.materials[target];
  if (look.value === null || current === undefined) return;
  const material = withGlassOf({ ...current, terms, normal_map }, glass);
  replaceLook(name, { ...look.value, materials: { ...look.value.materials, [target]: material } });
}

export function applyEntry(target: string, id: string): void {
  const entry = entries.value.find((candidate) => candidate.id === id);
  if (entry === undefined) return;
  if (entry.imported === undefined) applyTerms(target, entry.name, entry.terms);
  else applyImported(target, entry.imported);
  selectMaterial(target);
  if (selectedTerm.value >= entry.terms.length) selectTerm(0); // the open term was replaced
}

export function applyToSelected(id: string): void {
  if (selectedMaterial.value === null) showNote("Select a material in the scene first.");
  else applyEntry(selectedMaterial.value, id);
}
