/** The cost of a bake as text, or why it is impossible. */
import type { DryRunBody } from "../protocol";
import { formatBytes, formatCount, formatEstimatedTime } from "../ui/scale";

export type BakePlan = DryRunBody | Error | undefined;

export function PlanText({ plan }: { plan: BakePlan }) {
  if (plan === undefined) return <span class="plan quiet">Estimating…</span>;
  if (plan instanceof Error) return <span class="plan wrong">{plan.message}</span>;
  const [width, height] = plan.recipe.size;
  const time = plan.plan.seconds === null ? "time unknown" : formatEstimatedTime(plan.plan.seconds);
  return (
    <span
      class="plan"
      title={`${formatCount(plan.recipe.lights)} environment triangles, up to ${formatCount(plan.plan.rays)} rays`}
    >
      {width}×{height} · {time} · {formatBytes(plan.plan.store_bytes)} memory
    </span>
  );
}
