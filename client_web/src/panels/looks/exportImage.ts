/** Export: PNG as displayed, made on the client; EXR in linear radiance and turntables, rendered by the server. All
 * respect solo lights and light-path filters. */
import { signal } from "@preact/signals";
import { freeCameraOf } from "../../viewport/cameras/freeCamera";
import type { CameraPose } from "../../viewport/cameras/orbit";
import { limitRenderSize } from "../../session/clientRenderer";
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
import { interpolateLooks } from "../../session/net/api";
import { reportErrors, showError, showNote } from "../../ui/toasts";
import { encodePng } from "./displayImage";
import { download, renderAndSave } from "./renderJob";

/** The server's limit of a file name's length. */
const LONGEST_STEM = 120;

/** File name without extension: scene, view, kind (such as a turntable), active light filters, and color space. */
export function fileStem(kind = "", space = ""): string {
  const limits = lightFilters.value.map((limit) => limit.label);
  const nameParts = [scene.value?.name ?? "picture", activeViewName.value, kind, ...limits, space].join(" ").trim();
  return Array.from(nameParts.replace(/[^\p{L}\p{N}._-]+/gu, "-"))
    .slice(0, LONGEST_STEM)
    .join("");
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

/** Pose of the active view, if its camera is free. */
export const currentPose = (): CameraPose | null => freeCameraOf(activeViewName.peek())?.pose ?? null;

/** Image size of the active view, if its camera is free. */
export function currentSize(): [number, number] | null {
  const freeCamera = freeCameraOf(activeViewName.peek());
  return freeCamera === null ? null : limitRenderSize(...freeCamera.size);
}

/** Render the visible look, or other looks with the same filters, on the server; `fetchFrom`: the result's file. */
export async function startExport(
  exportName: string,
  fetchFrom: string,
  more: Pick<RenderRequest, "format"> & Partial<RenderRequest>,
) {
  const [id, current] = [bake.value, look.value];
  if (id === null || current === null) return;
  const looks = ((more.looks as Look[] | undefined) ?? [current]).map((exportedLook) => ({
    ...visibleLookOf(exportedLook),
  }));
  const request = {
    bake: id,
    view: activeViewName.value,
    name: fileStem(exportName),
    size: currentSize(),
    ...more,
    looks,
  };
  await renderAndSave(exportName, fetchFrom, request, lightFilterText());
}

/** What an EXR has beside the image: `layers` per light and per light path, or of direct and indirect light per light;
 * `aovs`. */
type ExrContents = Pick<RenderRequest, "layers" | "aovs">;

function exrKind({ layers, aovs }: ExrContents): string {
  if (aovs) return "AOVs";
  return layers === "light_groups" ? "light groups" : layers ? "" : "flat";
}

/** Export an EXR. */
export function exportExr(contents: ExrContents): Promise<void> {
  const pose = currentPose();
  return startExport("EXR", "frames/0", {
    format: "exr",
    ...contents,
    color_space: availableExrSpace.value,
    name: fileStem(exrKind(contents), availableExrSpace.value ?? ""),
    path: pose === null ? null : { cameras: [pose] },
  });
}

export const TURNTABLE_FRAMES = 72;

/** Full quality, or approximate as while the camera moves. */
export type RenderQuality = NonNullable<RenderRequest["quality"]>;

/** The rotating part of a turntable. */
export type TurntableRotation = NonNullable<Turntable["rotate"]>;
export const turntableRotation = signal<TurntableRotation>("camera");

export const crossingText = (material: string): string =>
  `The camera passes through “${material}” on its way; frames behind it show it from outside.`;

/** Tell if the camera of a path passes through a surface, as around a closed room. */
async function noteCrossing(path: Turntable): Promise<void> {
  const id = bake.peek();
  if (id === null) return;
  const { crosses } = await interpolateLooks({
    bake: id,
    looks: [{}],
    view: activeViewName.peek(),
    path: { ...path, turntable: 1 },
  });
  if (crosses !== null) showNote(crossingText(crosses));
}

/** Export a full rotation from the current camera: a PNG sequence in a ZIP, or a video. */
export function exportTurntable(format: "png" | "mp4", quality: RenderQuality): Promise<void> {
  const path = { turntable: TURNTABLE_FRAMES, rotate: turntableRotation.value, start_camera: currentPose() };
  void noteCrossing(path).catch(showError);
  return startExport("turntable", format === "mp4" ? "video.mp4" : "archive.zip", { format, path, quality });
}
