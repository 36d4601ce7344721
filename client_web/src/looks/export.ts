/** Export: PNG as displayed, made here; EXR in linear radiance and turntables, rendered by the server. All are of the light
 * that is shown: one source alone, or some of its paths. */
import { signal } from "@preact/signals";
import { eyeOf } from "../cameras/eye";
import type { Frame } from "../cameras/orbit";
import { eyeSize } from "../live/drawing";
import { whenShown } from "../live/displayViews";
import { whenExact } from "../live/exactness";
import { stage } from "../picture/stage";
import type { Look, RenderRequest, Turntable } from "../protocol";
import { lightLimits, lightLimitWords } from "../seen/limits";
import { seenOf } from "../seen/rendered";
import { bake } from "../state/bakes";
import { exrSpaceHere } from "../state/color";
import { look } from "../state/look";
import { scene } from "../state/scene";
import { viewName } from "../state/views";
import { attempt } from "../ui/toasts";
import { pngBlob } from "./image";
import { download, renderAndSave } from "./rendering";

/** As many characters as the server leaves of a name. */
const LONGEST_STEM = 120;

/** What a picture's file is called, without what it ends with: the scene, the view, what it is where it is no single picture
 * (a turntable), which light is missing, and which colour space it is in. */
export function fileStem(kind = "", space = ""): string {
  const limits = lightLimits.value.map((limit) => limit.words);
  const words = [scene.value?.name ?? "picture", viewName.value, kind, ...limits, space].join(" ").trim();
  return [...words.replace(/[^\p{L}\p{N}._-]+/gu, "-")].slice(0, LONGEST_STEM).join("");
}

export async function exportPng(): Promise<void> {
  const current = look.value;
  if (current === null || !stage.active.isThere) return;
  await attempt(async () => {
    await whenExact();
    await whenShown(current);
    const url = URL.createObjectURL(await pngBlob(stage.active.pixels, stage.active.alpha, current.display));
    download(url, `${fileStem()}.png`);
    window.setTimeout(() => URL.revokeObjectURL(url), 10_000);
  });
}

/** Where the view in hand is seen from, if its eye moves. */
export const eyeNow = (): Frame | null => eyeOf(viewName.peek())?.frame ?? null;

/** How large the pictures of the view in hand are, if its eye moves. */
export function sizeNow(): [number, number] | null {
  const eye = eyeOf(viewName.peek());
  return eye === null ? null : eyeSize(...eye.size);
}

/** Have the server render the look that is seen, or others in the same light; `fetchFrom` is the file of the finished batch. */
export async function render(what: string, fetchFrom: string, more: Pick<RenderRequest, "format"> & Partial<RenderRequest>) {
  const [id, current] = [bake.value, look.value];
  if (id === null || current === null) return;
  const looks = ((more.looks as Look[] | undefined) ?? [current]).map((of) => ({ ...seenOf(of) }));
  const asked = { bake: id, view: viewName.value, name: fileStem(what), size: sizeNow(), ...more, looks };
  await renderAndSave(what, fetchFrom, asked, lightLimitWords());
}

const KINDS = new Map<boolean | "light_groups", string>([[false, "flat"], ["light_groups", "light groups"]]);

/** With layers: one for each light and each kind of light path, where there are several; or both of each light. */
export function exportExr(layers: boolean | "light_groups"): Promise<void> {
  const eye = eyeNow();
  return render("EXR", "frames/0", {
    format: "exr",
    layers,
    color_space: exrSpaceHere.value,
    name: fileStem(KINDS.get(layers), exrSpaceHere.value ?? ""),
    path: eye === null ? null : { eyes: [eye] },
  });
}

export const TURNTABLE_FRAMES = 72;

/** What goes around in a turntable. */
export type Turns = NonNullable<Turntable["turns"]>;
export const turns = signal<Turns>("eye");

/** Once around, from where the eye is: numbered frames in a ZIP, or a video. `exact`: as where the eye rests. */
export function exportTurntable(format: "png" | "mp4", exact: boolean): Promise<void> {
  const path = { turntable: TURNTABLE_FRAMES, turns: turns.value, start: eyeNow() };
  return render("turntable", format === "mp4" ? "video.mp4" : "archive.zip", { format, path, exact });
}
