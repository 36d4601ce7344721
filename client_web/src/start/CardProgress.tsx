/** A scene without a picture: whether its first bake is under way, and how far. */
import { useEffect, useState } from "preact/hooks";
import { followBake } from "../net/events";
import type { BakeBody, SceneBody } from "../protocol";
import { bakingWords, hasProgress, useElapsed } from "../scene/baking";

export function CardProgress({ scene, onReady }: { scene: SceneBody; onReady(): void }) {
  const [bake, setBake] = useState<BakeBody | null>(null);
  const elapsed = useElapsed(bake);
  const newest = scene.bakes[0];
  useEffect(() => {
    if (newest === undefined) return undefined;
    return followBake(newest, (news) => {
      setBake(news);
      if (news.state === "ready") onReady();
    });
  }, [newest]);
  return (
    <span class="no-picture">
      {bake === null ? (newest === undefined ? "not baked yet" : "…") : bakingWords(bake, elapsed)}
      {bake?.state === "running" && (
        <progress max={1} value={hasProgress(bake) ? bake.progress : undefined} aria-label={`Bake of ${scene.name}`} />
      )}
    </span>
  );
}
