/** Uploaded IES files: listing, uploading, and assigning them to lights. */
import { signal } from "@preact/signals";
import { editValue } from "../../edit/edit";
import { history } from "../../edit/history";
import type { IesBody, Light, Rgb } from "../../protocol";
import { deleteIes, listIes } from "../../session/net/api";
import { uploadIes } from "../../session/net/upload";
import { reportErrors, showNote, showWarnings } from "../../ui/toasts";
import { editLight, lightPath, lights } from "./lightEdits";

/** Null until the server has listed them. */
export const iesFiles = signal<readonly IesBody[] | null>(null);
/** Progress text of the current upload. */
export const iesUploadProgress = signal<string | null>(null);

export const iesOf = (profile: string): IesBody | undefined =>
  iesFiles.value?.find((candidate) => candidate.profile === profile);

export async function loadIesFiles(): Promise<void> {
  await reportErrors(async () => {
    iesFiles.value = await listIes();
  });
}

/** The light with an IES file, as bright as the file says. */
export function withIes(light: Light, { profile, emission }: Pick<IesBody, "profile" | "emission">): Light {
  const value = Number(emission.toPrecision(6));
  return { ...light, profile, emission: [value, value, value] as Rgb } as Light;
}

/** Set the IES file of a light, and its emission to the candela of the file. */
export function assignIes(name: string, ies: IesBody): void {
  const light = lights.peek()[name];
  if (light === undefined) return;
  history.endGesture();
  editValue(`IES · ${ies.name}`, lightPath(name), withIes(light, ies));
}

/** Let a light emit evenly again. */
export function removeIes(name: string): void {
  history.endGesture();
  editLight("Remove IES file", name, "profile", null);
}

export async function uploadAndAssignIes(name: string, file: File): Promise<void> {
  if (iesUploadProgress.value !== null) return showNote("Still uploading; try again in a moment.");
  iesUploadProgress.value = `Uploading ${file.name}…`;
  const ies = await reportErrors(() => uploadIes(file, () => undefined), "files");
  iesUploadProgress.value = null;
  if (ies === undefined) return;
  await loadIesFiles();
  assignIes(name, ies);
  showWarnings(ies.warnings);
}

/** Delete an IES file after confirmation; the light emits evenly again. Saved looks keep theirs. */
export function offerToDeleteIes(name: string, { id, name: label }: IesBody): void {
  showNote(`Delete the IES file “${label}”? You can upload it again later.`, {
    label: "Delete",
    run: () =>
      void reportErrors(async () => {
        removeIes(name);
        await deleteIes(id);
        await loadIesFiles();
      }),
  });
}
