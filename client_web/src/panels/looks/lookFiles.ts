/** Look documents and light mixes as files: dropped on the editor, they change the look in one step. */
import { replaceLook } from "../../edit/edit";
import type { Look } from "../../protocol";
import { mixLook } from "../../session/net/api";
import { bake } from "../../state/bakes";
import { look } from "../../state/look";
import { fileBaseName } from "../../start/files/sceneFiles";
import { reportErrors, showNote } from "../../ui/toasts";
import { completeLook } from "./abCompare";

const LIGHT_MIX = "relume light mix";
const MAX_BYTES = 1 << 20;
const SECTIONS = ["materials", "environment", "background", "lights", "light_groups", "transport", "display"];

type Fields = Record<string, unknown>;

export const isLookFile = ({ name }: File): boolean => name.toLowerCase().endsWith(".json");

const isFields = (value: unknown): value is Fields =>
  typeof value === "object" && value !== null && !Array.isArray(value);

/** The light mix or the partial look of a file. */
export function readLookFile(text: string): { mix: Fields } | { partial: Partial<Look> } {
  let document: unknown;
  try {
    document = JSON.parse(text);
  } catch {
    throw new Error("This file is not JSON.");
  }
  if (isFields(document) && document["format"] === LIGHT_MIX) return { mix: document };
  if (
    !isFields(document) ||
    !Object.entries(document).every(([name, part]) => SECTIONS.includes(name) && isFields(part))
  )
    throw new Error("This file is neither a look nor a light mix.");
  return { partial: document };
}

/** The look that a file makes of the current one, and a sentence for each thing that it does not have. */
async function lookOfFile(current: Look, bakeId: string, text: string): Promise<{ look: Look; warnings: string[] }> {
  const content = readLookFile(text);
  if ("partial" in content) return { look: completeLook(content.partial), warnings: [] };
  const { look: mixed, warnings } = await mixLook(bakeId, current, content.mix);
  return { look: mixed as unknown as Look, warnings };
}

/** Apply a dropped file. */
export async function applyLookFile(file: File): Promise<void> {
  await reportErrors(async () => {
    const [current, bakeId] = [look.peek(), bake.peek()];
    if (current === null || bakeId === null) return;
    if (file.size > MAX_BYTES) throw new Error(`${file.name} is larger than a look can be (1 MB).`);
    const { look: next, warnings } = await lookOfFile(current, bakeId, await file.text());
    replaceLook(fileBaseName(file.name), next);
    showNote([`“${fileBaseName(file.name)}” applied.`, ...warnings].join(" "));
  });
}
