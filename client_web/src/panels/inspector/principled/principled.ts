/** Principled parameters of materials. The server reads and makes them, so that they are those of imports and exports;
 * edits are sent one at a time, and those of one gesture that wait are merged. */
import { signal } from "@preact/signals";
import { editLook } from "../../../edit/edit";
import { history } from "../../../edit/history";
import { makePrincipledTerms, readPrincipled } from "../../../session/net/api";
import type { Look, MaterialLook, PrincipledBody, PrincipledParameters, PrincipledTermsBody } from "../../../protocol";
import { jsonPointer } from "../../../state/document/pointer";
import { look } from "../../../state/look";
import { scene } from "../../../state/scene";
import { selectedMaterials } from "../../../state/selection";
import { reportErrors } from "../../../ui/toasts";

const MAX_READINGS = 200;

/** Readings by material, terms and glass; those of made terms have the parameters that made them. */
const readings = signal<ReadonlyMap<string, PrincipledBody>>(new Map());

function keyOf(name: string, material: MaterialLook): string {
  return JSON.stringify([scene.peek()?.id, name, material.terms, material.glass ?? null]);
}

function store(name: string, material: MaterialLook, reading: PrincipledBody): void {
  const entries = [...readings.peek()].slice(1 - MAX_READINGS);
  readings.value = new Map([...entries, [keyOf(name, material), reading]]);
}

/** The reading of a material; undefined until it is read. */
export function storedReading(name: string, material: MaterialLook): PrincipledBody | undefined {
  return readings.value.get(keyOf(name, material));
}

/** Read a material. */
export async function readMaterial(name: string, material: MaterialLook): Promise<PrincipledBody> {
  const stored = readings.peek().get(keyOf(name, material));
  if (stored !== undefined) return stored;
  const { terms, glass } = material;
  const reading = await readPrincipled({
    terms: terms,
    glass: glass === undefined || glass === null ? null : { ...glass },
    scene: scene.peek()?.id ?? null,
    material: material.base ?? name,
  });
  store(name, material, reading);
  return reading;
}

function withTerms(material: MaterialLook, { terms, glass }: PrincipledTermsBody): MaterialLook {
  return glass === null || glass === undefined ? { ...material, terms } : { ...material, terms, glass };
}

interface PrincipledEdit {
  label: string;
  change: Partial<PrincipledParameters>;
  materials: readonly string[];
  gesture: number;
}

const queue: PrincipledEdit[] = [];
let isSending = false;

/** Parameters of the edited material until its terms are made. */
export const editedParameters = signal<{ material: string; parameters: PrincipledParameters } | null>(null);

/** Change parameters of all selected materials. parameters: those of the first. */
export async function editPrincipled(
  label: string,
  parameters: PrincipledParameters,
  change: Partial<PrincipledParameters>,
): Promise<void> {
  const materials = selectedMaterials.peek();
  const [material] = materials;
  if (material === undefined) return;
  editedParameters.value = { material, parameters: { ...parameters, ...change } };
  const gesture = history.continueGesture();
  const last = queue.at(-1);
  if (last?.gesture === gesture) Object.assign(last, { label, change: { ...last.change, ...change } });
  else queue.push({ label, change, materials, gesture });
  if (!isSending) await reportErrors(sendEdits);
}

async function sendEdits(): Promise<void> {
  isSending = true;
  try {
    for (let edit = queue.shift(); edit !== undefined; edit = queue.shift()) await applyEdit(edit);
  } finally {
    isSending = false;
    queue.length = 0;
    editedParameters.value = null;
  }
}

/** A material with changed parameters, and its reading; null if it is not principled. */
async function makeMaterial(
  name: string,
  change: Partial<PrincipledParameters>,
): Promise<[string, PrincipledBody] | null> {
  const material = look.peek()?.materials[name];
  if (material === undefined) return null;
  const reading = await readMaterial(name, material);
  if (reading.reason !== null) return null;
  const { terms, glass } = material;
  const parameters = { ...reading.parameters, ...change };
  const made = await makePrincipledTerms({
    parameters: { ...parameters },
    terms: terms,
    glass: glass === undefined || glass === null ? null : { ...glass },
    texture_means: reading.texture_means,
  });
  return [name, { ...reading, ...made, parameters }];
}

async function applyEdit({ label, change, materials, gesture }: PrincipledEdit): Promise<void> {
  const made = await Promise.all(materials.map((name) => makeMaterial(name, change)));
  assignMaterials(
    label,
    made.filter((entry) => entry !== null),
    gesture,
  );
}

function assignMaterials(label: string, made: readonly [string, PrincipledBody][], gesture: number): void {
  const current = look.peek();
  const [first] = made;
  if (current === null || first === undefined) return;
  const next: Look = { ...current, materials: { ...current.materials } };
  for (const [name, reading] of made) {
    const material = next.materials[name];
    if (material === undefined) continue;
    next.materials[name] = withTerms(material, reading);
    store(name, next.materials[name], { ...reading, reason: null, error: 0 });
  }
  editLook(label, jsonPointer("materials", first[0], "terms"), next, gesture, made.length - 1);
}

/** Replace a material by the closest principled one. */
export function replaceByClosest(name: string, reading: PrincipledBody): void {
  history.endGesture();
  assignMaterials("Replace by principled material", [[name, reading]], history.continueGesture());
  history.endGesture();
}
