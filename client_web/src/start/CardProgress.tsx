/** A scene without a picture: whether its first bake is under way, and how far. */
import { useEffect, useState } from "preact/hooks";
import { followBake } from "../net/events";
import type { BakeBody, SceneBody } from "../protocol";
import { formatSeconds } from "../ui/scale";

function words(bake: BakeBody): string {
  if (bake.state === "queued") return "waits for its turn";
  if (bake.state !== "running") return `bake ${bake.state}`;
  return bake.seconds_left === null ? "baking" : `baking, ${formatSeconds(bake.seconds_left)} left`;
}

export function CardProgress({ scene, onReady }: { scene: SceneBody; onReady(): void }) {
  const [bake, setBake] = useState<BakeBody | null>(null);
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
      {bake === null ? (newest === undefined ? "not baked yet" : "…") : words(bake)}
      {bake?.state === "running" && <progress max={1} value={bake.progress} aria-label={`Bake of ${scene.name}`} />}
    </span>
  );
}
