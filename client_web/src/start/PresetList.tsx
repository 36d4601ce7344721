/** What can be baked: which light, which views, and the three presets with what each will cost, before anything starts. */
import { useEffect, useId, useState } from "preact/hooks";
import { planBake } from "../net/api";
import { MAX_VIEWS_SHOWN, type DryRunBody, type SceneBody } from "../protocol";
import type { BakeChoice, Preset } from "../state/open";
import { formatBytes, formatCount, formatSeconds } from "../ui/scale";
import { METHODS, type Method } from "./methods";

const PRESETS: { name: Preset; label: string; help: string }[] = [
  { name: "preview", label: "Preview", help: "to find the look" },
  { name: "good", label: "Good", help: "for most work" },
  { name: "final", label: "Final", help: "for sharp highlights and print" },
];

type Plans = Partial<Record<Preset, DryRunBody | Error>>;

function usePlans(scene: string, method: Method, views: readonly string[]): Plans {
  const [plans, setPlans] = useState<Plans>({});
  useEffect(() => {
    let stale = false;
    setPlans({});
    for (const { name } of PRESETS) {
      planBake({ scene, method, preset: name, views: [...views] }).then(
        (plan) => !stale && setPlans((before) => ({ ...before, [name]: plan })),
        (error: Error) => !stale && setPlans((before) => ({ ...before, [name]: error })),
      );
    }
    return () => {
      stale = true;
    };
  }, [scene, method, views]);
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

interface MethodsProps {
  chosen: Method;
  onChoose(method: Method): void;
}

function Methods({ chosen, onChoose }: MethodsProps) {
  const group = useId();
  return (
    <fieldset class="bake-methods">
      <legend>Light</legend>
      {METHODS.map(({ name, label, help }) => (
        <label key={name}>
          <input type="radio" name={group} checked={name === chosen} onChange={() => onChoose(name)} />
          <b>{label}</b>
          <small>{help}</small>
        </label>
      ))}
    </fieldset>
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
  /** What is chosen at first. */
  method: Method;
  views: readonly string[];
  action: string;
  onChoose(choice: BakeChoice): void;
}

export function PresetList({ scene, method: initial, views, action, onChoose }: Props) {
  const [method, setMethod] = useState(initial);
  const [chosen, setChosen] = useState([...views]);
  const plans = usePlans(scene.id, method, chosen);
  return (
    <>
      <Methods chosen={method} onChoose={setMethod} />
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
              onClick={() => onChoose({ method, preset: name, views: chosen })}
            >
              {action}
            </button>
          </li>
        ))}
      </ul>
    </>
  );
}
