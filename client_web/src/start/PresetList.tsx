/** What can be baked: which views, and the three presets with what each will cost, before anything starts. */
import { useEffect, useState } from "preact/hooks";
import { planBake } from "../net/api";
import { MAX_VIEWS_SHOWN, type DryRunBody, type SceneBody } from "../protocol";
import type { BakeChoice, Preset } from "../state/open";
import { formatBytes, formatCount, formatSeconds } from "../ui/scale";

const PRESETS: { name: Preset; label: string; help: string }[] = [
  { name: "preview", label: "Preview", help: "to find the look" },
  { name: "good", label: "Good", help: "for most work" },
  { name: "final", label: "Final", help: "for sharp highlights and print" },
];

type Plans = Partial<Record<Preset, DryRunBody | Error>>;

function usePlans(scene: string, views: readonly string[]): Plans {
  const [plans, setPlans] = useState<Plans>({});
  useEffect(() => {
    let stale = false;
    setPlans({});
    for (const { name } of PRESETS) {
      planBake({ scene, method: "direct", preset: name, views: [...views] }).then(
        (plan) => !stale && setPlans((before) => ({ ...before, [name]: plan })),
        (error: Error) => !stale && setPlans((before) => ({ ...before, [name]: error })),
      );
    }
    return () => {
      stale = true;
    };
  }, [scene, views]);
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
      up to {formatCount(plan.plan.rays)} rays · {time} · {formatBytes(plan.plan.store_bytes)}
    </span>
  );
}

interface ViewsProps {
  all: readonly string[];
  chosen: readonly string[];
  onChoose(views: string[]): void;
}

/** A box for each view, in the scene's order; the last one that is chosen stays. */
function Views({ all, chosen, onChoose }: ViewsProps) {
  const toggle = (name: string) => onChoose(all.filter((each) => chosen.includes(each) !== (each === name)));
  return (
    <fieldset class="bake-views">
      <legend>Views{all.length > MAX_VIEWS_SHOWN && `, of which the editor shows ${MAX_VIEWS_SHOWN} at once`}</legend>
      {all.map((name) => (
        <label key={name}>
          <input
            type="checkbox"
            checked={chosen.includes(name)}
            disabled={chosen.length === 1 && chosen[0] === name}
            onChange={() => toggle(name)}
          />
          {name}
        </label>
      ))}
    </fieldset>
  );
}

interface Props {
  scene: SceneBody;
  /** The views that are chosen at first. */
  views: readonly string[];
  action: string;
  onChoose(choice: BakeChoice): void;
}

export function PresetList({ scene, views, action, onChoose }: Props) {
  const [chosen, setChosen] = useState([...views]);
  const plans = usePlans(scene.id, chosen);
  return (
    <>
      {scene.views.length > 1 && (
        <Views all={scene.views.map((view) => view.name)} chosen={chosen} onChoose={setChosen} />
      )}
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
              onClick={() => onChoose({ preset: name, views: chosen })}
            >
              {action}
            </button>
          </li>
        ))}
      </ul>
    </>
  );
}
