/** Progress of the first bake of a scene without a preview. */
import { useEffect, useState } from "preact/hooks";
import { subscribeToBake } from "../session/net/bakeEvents";
import type { BakeBody, SceneBody } from "../protocol";
import { bakeProgressText, hasProgress, useElapsedSeconds } from "../session/scene/bakeStatus";

export function BakeProgress({ scene, onReady }: { scene: SceneBody; onReady: () => void }) {
  const [bake, setBake] = useState<BakeBody | null>(null);
  const elapsed = useElapsedSeconds(bake);
  const newest = scene.bakes[0];
  useEffect(() => {
    if (newest === undefined) return undefined;
    return subscribeToBake(newest, (update) => {
      setBake(update);
      if (update.state === "ready") onReady();
    });
  }, [newest, onReady]);
  return (
    <span class="bake-progress">
      {bake === null ? (newest === undefined ? "Not baked: clay picture" : "…") : bakeProgressText(bake, elapsed)}
      {bake?.state === "running" && (
        <progress max={1} value={hasProgress(bake) ? bake.progress : undefined} aria-label={`Bake of ${scene.name}`} />
      )}
    </span>
  );
}
