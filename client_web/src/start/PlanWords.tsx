/** What a bake will cost, in words; or why it cannot be. */
import type { DryRunBody } from "../protocol";
import { formatBytes, formatCount, formatForeseen } from "../ui/scale";

export type Planned = DryRunBody | Error | undefined;

export function PlanWords({ plan }: { plan: Planned }) {
  if (plan === undefined) return <span class="plan quiet">Planning…</span>;
  if (plan instanceof Error) return <span class="plan wrong">{plan.message}</span>;
  const [width, height] = plan.recipe.size;
  const time = plan.plan.seconds === null ? "time not known yet" : formatForeseen(plan.plan.seconds);
  return (
    <span class="plan">
      {width}×{height}, {formatCount(plan.recipe.lights)} light triangles
      <br />
      up to {formatCount(plan.plan.rays)} rays · {time} · {formatBytes(plan.plan.store_bytes)}
    </span>
  );
}
