/** Export: PNG as displayed, made here; EXR in linear radiance and turntables, rendered by the server. All are of the light
 * that is shown: one source alone, or some of its paths. */
import { signal } from "@preact/signals";
import { freeCameraOf } from "../../viewport/cameras/freeCamera";
import type { CameraPose } from "../../viewport/cameras/orbit";
import { limitRenderSize } from "../../session/clientRendering";
import { untilToneMapReady } from "../../session/colorTransforms";
import { untilExact } from "../../session/fidelityState";
import { stage } from "../../render/renderStage";
import type { Look, RenderRequest, Turntable } from "../../protocol";
import { lightFilters, lightFilterText } from "../../state/visibility/activeFilters";
import { visibleLookOf } from "../../state/visibility/displayState";
import { bake } from "../../state/bakes";
import { availableExrSpace } from "../../state/color";
import { look } from "../../state/look";
import { scene } from "../../state/scene";
import { activeViewName } from "../../state/views";
import { reportErrors } from "../../ui/toasts";
import { encodePng } from "./displayImage";
import { download, renderAndSave } from "./renderJob";

/** As many characters as the server leaves of a name. */
const LONGEST_STEM = 120;

/** What an image's file is called, without what it ends with: the scene, the view, what it is where it is no single image
 * (a turntable), which light is missing, and which color space it is in. */
export function fileStem(kind = "", space = ""): string {
  const limits = lightFilters.value.map((limit) => limit.label);
  const nameParts = [scene.value?.name ?? "picture", activeViewName.value, kind, ...limits, space].join(" ").trim();
  return [...nameParts.replace(/[^\p{L}\p{N}._-]+/gu, "-")].slice(0, LONGEST_STEM).join("");
}

export async function exportPng(): Promise<void> {
  const current = look.value;
  if (current === null || !stage.active.hasPixels) return;
  await reportErrors(async () => {
    await untilExact();
    await untilToneMapReady(current);
    const url = URL.createObjectURL(await encodePng(stage.active.pixels, stage.active.alpha, current.display));
    download(url, `${fileStem()}.png`);
    window.setTimeout(() => URL.revokeObjectURL(url), 10_000);
  });
}

/** Pose of the focused view, if its camera is free. */
export const currentPose = (): CameraPose | null => freeCameraOf(activeViewName.peek())?.pose ?? null;

/** Image size of the focused view, if its camera is free. */
export function currentSize(): [number, number] | null {
  const freeCamera = freeCameraOf(activeViewName.peek());
  return freeCamera === null ? null : limitRenderSize(...freeCamera.size);
}

/** Have the server render the visible look, or others in the same light; `fetchFrom` is the file of the finished batch. */
export async function startExport(exportName: string, fetchFrom: string, more: Pick<RenderRequest, "format"> & Partial<RenderRequest>) {
  const [id, current] = [bake.value, look.value];
  if (id === null || current === null) return;
  const looks = ((more.looks as Look[] | undefined) ?? [current]).map((exportedLook) => ({ ...visibleLookOf(exportedLook) }));
  const request = { bake: id, view: activeViewName.value, name: fileStem(exportName), size: currentSize(), ...more, looks };
  await renderAndSave(exportName, fetchFrom, request, lightFilterText());
}

const KINDS = new Map<boolean | "light_groups", string>([[false, "flat"], ["light_groups", "light groups"]]);

/** With layers: one for each light and each kind of light path, where there are several; or both of each light. */
export function exportExr(layers: boolean | "light_groups"): Promise<void> {
  const pose = currentPose();
  return startExport("EXR", "frames/0", {
    format: "exr",
    layers,
    color_space: availableExrSpace.value,
    name: fileStem(KINDS.get(layers), availableExrSpace.value ?? ""),
    path: pose === null ? null : { cameras: [pose] },
  });
}

export const TURNTABLE_FRAMES = 72;

/** Exact, or as while the camera moves. */
export type RenderQuality = NonNullable<RenderRequest["quality"]>;

/** What goes around in a turntable. */
export type TurntableRotation = NonNullable<Turntable["rotate"]>;
export const turntableRotation = signal<TurntableRotation>("camera");

/** Once around, from where the camera is: numbered frames in a ZIP, or a video. `quality`: exact, or as while the camera moves. */
export function exportTurntable(format: "png" | "mp4", quality: RenderQuality): Promise<void> {
  const path = { turntable: TURNTABLE_FRAMES, rotate: turntableRotation.value, start_camera: currentPose() };
  return startExport("turntable", format === "mp4" ? "video.mp4" : "archive.zip", { format, path, quality });
}
