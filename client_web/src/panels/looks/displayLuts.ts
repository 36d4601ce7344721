/** Display LUTs: listing, importing .cube files, choosing and deleting them. */
import { computed, signal } from "@preact/signals";
import { editValue } from "../../edit/edit";
import type { LutBody } from "../../protocol";
import { deleteLut, listLuts } from "../../session/net/api";
import { uploadLut } from "../../session/net/upload";
import { look } from "../../state/look";
import { reportErrors, showNote, showWarnings } from "../../ui/toasts";

export const LUT_SUFFIX = ".cube";
export const luts = signal<readonly LutBody[]>([]);
/** Progress text of the import. */
export const lutProgress = signal<string | null>(null);
/** The look's LUT, if it is listed. */
export const currentLut = computed(() => luts.value.find(({ lut }) => lut === look.value?.display.lut) ?? null);

export const isLutFile = ({ name }: File): boolean => name.toLowerCase().endsWith(LUT_SUFFIX);

export async function loadLuts(): Promise<void> {
  await reportErrors(async () => {
    luts.value = await listLuts();
  });
}

/** Apply a LUT after the tone map; null: none. */
export function chooseLut(lut: string | null): void {
  const name = luts.value.find((each) => each.lut === lut)?.name ?? "none";
  editValue(`LUT · ${name}`, "/display/lut", lut);
}

/** Import a .cube file, and apply it. */
export async function importLutFile(file: File): Promise<void> {
  const onProgress = (fraction: number) =>
    (lutProgress.value = fraction < 1 ? `Uploading ${file.name}…` : `Processing ${file.name}…`);
  onProgress(0);
  const body = await reportErrors(() => uploadLut(file, onProgress), "files");
  lutProgress.value = null;
  if (body === undefined) return;
  await loadLuts();
  chooseLut(body.lut);
  showWarnings(body.warnings);
}

/** Delete a LUT after confirmation. */
export function offerToDeleteLut({ lut, name }: LutBody): void {
  showNote(`Delete the LUT “${name}”? This can't be undone.`, {
    label: "Delete",
    run: () =>
      void reportErrors(async () => {
        chooseLut(null);
        await deleteLut(lut);
        await loadLuts();
      }),
  });
}
