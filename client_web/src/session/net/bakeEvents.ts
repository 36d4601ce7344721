/** A bake's progress as server-sent events; falls back to polling if the stream breaks. */
import type { BakeBody } from "../../protocol";
import { getBake } from "./api";
import { serverUrl } from "./serverUrl";

const POLL_MS = 1500;

function isFinished(bake: BakeBody): boolean {
  return bake.state === "ready" || bake.state === "failed" || bake.state === "canceled";
}

/** Call `onUpdate` with every state until the bake ends. Returns a function that stops this. */
export function subscribeToBake(id: string, onUpdate: (bake: BakeBody) => void): () => void {
  let stopped = false;
  let timer = 0;
  const source = new EventSource(serverUrl(`/api/bakes/${encodeURIComponent(id)}/events`));
  const stop = () => {
    stopped = true;
    source.close();
    clearTimeout(timer);
  };
  const deliver = (bake: BakeBody) => {
    if (stopped) return;
    if (isFinished(bake)) stop();
    onUpdate(bake);
  };
  const poll = async () => {
    const bake = await getBake(id).catch(() => null);
    if (bake !== null) deliver(bake);
    if (!stopped) timer = window.setTimeout(() => void poll(), POLL_MS);
  };
  const read = (event: MessageEvent<string>) => deliver(JSON.parse(event.data) as BakeBody);
  source.onmessage = read;
  source.addEventListener("bake", read);
  source.onerror = () => {
    source.close();
    if (!stopped) void poll();
  };
  return stop;
}

/** Resolves with the bake when it ends. */
export function waitForBake(id: string, progress: (bake: BakeBody) => void): Promise<BakeBody> {
  return new Promise((resolve) => {
    subscribeToBake(id, (bake) => {
      progress(bake);
      if (isFinished(bake)) resolve(bake);
    });
  });
}
