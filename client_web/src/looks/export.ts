/** Export: PNG as displayed, made here; EXR in linear radiance, rendered by the server. Both are of the light that is
 * shown: one source alone, or some of its paths. */
import { getRender, problemText, startRender } from "../net/api";
import { lightLimits, lightLimitWords } from "../picture/limits";
import { stage } from "../picture/stage";
import type { RenderBody } from "../protocol";
import { whenExact } from "../state/live";
import { seenOf } from "../state/solo";
import { bake, look, scene, viewName } from "../state/store";
import { attempt, note } from "../ui/toasts";
import { pngBlob } from "./image";

const POLL_MS = 300;

function fileName(suffix: string): string {
  const limits = lightLimits.value.map((limit) => limit.words);
  const stem = [scene.value?.name ?? "picture", viewName.value, ...limits].join(" ").trim().replace(/[^\p{L}\p{N}._-]+/gu, "-");
  return `${stem}.${suffix}`;
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
    download(url, fileName("png"));
    window.setTimeout(() => URL.revokeObjectURL(url), 10_000);
  });
}

async function finished(render: RenderBody): Promise<RenderBody> {
  let state = render;
  while (state.state === "queued" || state.state === "running") {
    await new Promise((done) => setTimeout(done, POLL_MS));
    state = await getRender(state.id);
  }
  if (state.state === "failed") throw new Error(`The EXR could not be rendered: ${problemText(state.problem)}`);
  return state;
}

export async function exportExr(): Promise<void> {
  const [id, current] = [bake.value, look.value];
  if (id === null || current === null) return;
  await attempt(async () => {
    const [name, shown] = [fileName("exr"), seenOf(current)];
    note(`Rendering the EXR on the server${lightLimitWords()}…`);
    const render = await finished(
      await startRender({ bake: id, view: viewName.value, looks: [{ ...shown }], format: "exr" }),
    );
    download(`/api/renders/${encodeURIComponent(render.id)}/frames/0`, name);
  });
}
