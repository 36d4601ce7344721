/** Loads the server's OpenColorIO config, and the tables of its views and of display LUTs on demand. */
import { computed, effect } from "@preact/signals";
import { parseLut, type LutTable } from "../render/color/lutTable";
import { getColor, getLut, getLutTable } from "./net/api";
import type { Look } from "../protocol";
import {
  colorConfig,
  hasOcioView,
  toneMapKey,
  lutFor,
  lutTables,
  displayLut,
  displayLutFor,
  toneMap,
} from "../state/color";
import { look } from "../state/look";
import { reportErrors } from "../ui/toasts";

export async function loadColor(): Promise<void> {
  colorConfig.value = await getColor();
}

const targetToneMap = computed(() => look.value?.display.tone_map ?? "agx");
const targetLut = computed(() => look.value?.display.lut ?? null);
const requestedTables = new Set<string>();

/** Tables being loaded; a failed one is requested again when it is chosen again. */
async function fetchTable(key: string, fetch: () => Promise<ArrayBuffer>): Promise<void> {
  if (requestedTables.has(key) || lutTables.peek().get(key)) return;
  requestedTables.add(key);
  let table: LutTable | null = null;
  await reportErrors(async () => (table = parseLut(await fetch())));
  requestedTables.delete(key);
  lutTables.value = new Map(lutTables.peek()).set(key, table);
}

/** Resolves when the display transform of a look is loaded. */
export function untilToneMapReady(targetLook: Look): Promise<void> {
  return new Promise((done) => {
    const stop = effect(() => {
      const { tone_map, lut } = targetLook.display;
      if (lutFor(tone_map) === null || displayLutFor(lut) === undefined) return;
      queueMicrotask(() => {
        stop();
        done();
      });
    });
  });
}

/** Keep the previous display transform until the new table is loaded. */
export function trackToneMap(): void {
  effect(() => void (toneMap.value = lutFor(targetToneMap.value) ?? toneMap.peek()));
  effect(() => {
    const table = displayLutFor(targetLut.value);
    if (table !== undefined) displayLut.value = table;
  });
  effect(() => {
    const name = targetLut.value;
    if (name !== null) void fetchTable(name, () => getLutTable(name));
  });
  effect(() => {
    const [requested, config] = [targetToneMap.value, colorConfig.value?.id ?? null];
    if (typeof requested !== "string" && config !== null && hasOcioView(requested))
      void fetchTable(toneMapKey(requested), () => getLut(config, requested));
  });
}
