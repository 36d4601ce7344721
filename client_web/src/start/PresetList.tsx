/** The three presets of a bake with what each will cost, before anything starts. */
import { useEffect, useState } from "preact/hooks";
import { planBake } from "../net/api";
import type { DryRunBody } from "../protocol";
import type { Preset } from "../state/open";
import { formatBytes, formatCount, formatSeconds } from "../ui/scale";

const PRESETS: { name: Preset; label: string; help: string }[] = [
  { name: "preview", label: "Preview", help: "to find the look" },
  { name: "good", label: "Good", help: "for most work" },
  { name: "final", label: "Final", help: "for sharp highlights and print" },
];

type Plans = Partial<Record<Preset, DryRunBody | Error>>;

function usePlans(scene: string): Plans {
  const [plans, setPlans] = useState<Plans>({});
  useEffect(() => {
    let stale = false;
    setPlans({});
    for (const { name } of PRESETS) {
      planBake({ scene, method: "direct", preset: name }).then(
        (plan) => !stale && setPlans((before) => ({ ...before, [name]: plan })),
        (error: Error) => !stale && setPlans((before) => ({ ...before, [name]: error })),
      );
    }
    return () => {
      stale = true;
    };
  }, [scene]);
  return plans;
}

function Plan({ plan }: { plan: DryRunBody | Error | undefined }) {
  if (plan === undefined) return <span class="plan quiet">Planning…</span>;
  if (plan instanceof Error) return <span class="plan wrong">{plan.message}</span>;
  const [width, height] = plan.recipe.size;
  const time = plan.plan.seconds === null ? "time not known yet" : `about ${formatSeconds(plan.plan.seconds)}`;
  return (
    <span class="plan">
      {width}×{height}, {formatCount(plan.recipe.lights)} light triangles
      <br />
      {formatCount(plan.plan.rays)} rays · {time} · {formatBytes(plan.plan.store_bytes)}
    </span>
  );
}

interface Props {
  scene: string;
  action: string;
  onChoose(preset: Preset): void;
}

export function PresetList({ scene, action, onChoose }: Props) {
  const plans = usePlans(scene);
  return (
    <ul class="presets">
      {PRESETS.map(({ name, label, help }) => (
        <li key={name}>
          <span class="preset-name">
            <b>{label}</b> {help}
          </span>
          <Plan plan={plans[name]} />
          <button
            class={name === "good" ? "primary" : ""}
            disabled={plans[name] instanceof Error}
            onClick={() => onChoose(name)}
          >
            {action}
          </button>
        </li>
      ))}
    </ul>
  );
}
