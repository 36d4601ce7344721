/** Fetches what the server's OpenColorIO config has, and the tables of its views as they are wanted. */
import { computed, effect } from "@preact/signals";
import { tableOf, type Table } from "../color/table";
import { getColor, getLut } from "../net/api";
import type { Look, OcioView } from "../protocol";
import { colorConfig, isHere, keyOf, tableFor, tables, toneMap } from "../state/color";
import { look } from "../state/look";
import { attempt } from "../ui/toasts";

export async function loadColor(): Promise<void> {
  colorConfig.value = await getColor();
}

const wanted = computed(() => look.value?.display.tone_map ?? "agx");
const asked = new Set<string>();

/** One that could not be had is asked for again when it is chosen again. */
async function fetchTable(config: string, view: OcioView): Promise<void> {
  const key = keyOf(view);
  if (asked.has(key) || tables.peek().get(key)) return;
  asked.add(key);
  let table: Table | null = null;
  await attempt(async () => (table = tableOf(await getLut(config, view))));
  asked.delete(key);
  tables.value = new Map(tables.peek()).set(key, table);
}

/** Resolves when what a look is shown by is there. */
export function whenShown(of: Look): Promise<void> {
  return new Promise((done) => {
    const stop = effect(() => void (tableFor(of.display.tone_map) !== null && queueMicrotask(() => (stop(), done()))));
  });
}

/** What was shown stays until a view's table has come. */
export function followToneMap(): void {
  effect(() => void (toneMap.value = tableFor(wanted.value) ?? toneMap.peek()));
  effect(() => {
    const [of, config] = [wanted.value, colorConfig.value?.id ?? null];
    if (typeof of !== "string" && config !== null && isHere(of)) void fetchTable(config, of);
  });
}
