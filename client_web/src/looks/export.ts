/** Export: PNG as displayed, made here; EXR in linear radiance, rendered by the server. Both are of the light that is
 * shown: one source alone, or some of its paths. */
import { signal } from "@preact/signals";
import { whenExact } from "../live/exactness";
import { deleteRender, getRender, problemText, startRender } from "../net/api";
import { stage } from "../picture/stage";
import type { RenderBody } from "../protocol";
import { lightLimits, lightLimitWords } from "../seen/limits";
import { seenOf } from "../seen/rendered";
import { bake } from "../state/bakes";
import { look } from "../state/look";
import { scene } from "../state/scene";
import { viewName } from "../state/views";
import { attempt, note } from "../ui/toasts";
import { pngBlob } from "./image";

const POLL_MS = 300;

/** The EXR that the server renders now: how far it is, and a way to stop it. */
export const exporting = signal<{ progress: number; stop(): void } | null>(null);

/** As many characters as the server leaves of a name. */
const LONGEST_STEM = 120;

/** What a picture's file is called, without what it ends with: the scene, the view, and which light is missing. */
export function fileStem(): string {
  const limits = lightLimits.value.map((limit) => limit.words);
  const words = [scene.value?.name ?? "picture", viewName.value, ...limits].join(" ").trim();
  return [...words.replace(/[^\p{L}\p{N}._-]+/gu, "-")].slice(0, LONGEST_STEM).join("");
}

function download(href: string, name: string): void {
  const link = document.createElement("a");
  link.href = href;
  link.download = name;
  link.click();
}

export async function exportPng(): Promise<void> {
  const current = look.value;
  if (current === null || !stage.active.isThere) return;
  await attempt(async () => {
    await whenExact();
    const url = URL.createObjectURL(await pngBlob(stage.active.pixels, stage.active.alpha, current.display));
    download(url, `${fileStem()}.png`);
    window.setTimeout(() => URL.revokeObjectURL(url), 10_000);
  });
}

/** Follow a render to its end; null where it was stopped on the way. */
async function finished(render: RenderBody): Promise<RenderBody | null> {
  let [state, isStopped] = [render, false];
  const stop = () => {
    isStopped = true;
    exporting.value = null;
    void attempt(() => deleteRender(render.id));
  };
  while (!isStopped && (state.state === "queued" || state.state === "running")) {
    exporting.value = { progress: state.progress, stop };
    await new Promise((done) => setTimeout(done, POLL_MS));
    if (!isStopped) state = await getRender(render.id);
  }
  if (isStopped) return null;
  if (state.state === "failed") throw new Error(`The EXR could not be rendered: ${problemText(state.problem)}`);
  return state;
}

/** With layers: one for each light and each kind of light path, where there are several. */
export async function exportExr(layers: boolean): Promise<void> {
  const [id, current] = [bake.value, look.value];
  if (id === null || current === null || exporting.value !== null) return;
  await attempt(async () => {
    const shown = seenOf(current);
    note(`Rendering the EXR on the server${lightLimitWords()}…`);
    const looks = [{ ...shown }];
    const asked = await startRender({ bake: id, view: viewName.value, looks, format: "exr", layers, name: fileStem() });
    const render = await finished(asked);
    if (render !== null) download(`/api/renders/${encodeURIComponent(render.id)}/frames/0`, "");
  }).finally(() => (exporting.value = null));
}
