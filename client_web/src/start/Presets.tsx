/** Bake settings: method, views, aspect ratio, and three presets with their estimated costs. */
import { useEffect, useId, useState } from "preact/hooks";
import type { CameraPose } from "../viewport/cameras/orbit";
import { planBake } from "../session/net/api";
import type { SceneBody } from "../protocol";
import type { BakeSettings, BakePreset } from "../session/scene/bakeSettings";
import { BAKE_METHODS, type BakeMethod } from "../session/scene/bakeMethods";
import { resizeToAspect, aspectChoicesFor, type BakeSize } from "../session/scene/recipe";
import { RadioRow } from "../ui/RadioRow";
import { CustomRecipe } from "./CustomRecipe";
import { PlanText, type BakePlan } from "./PlanText";
import { ViewPicker } from "./ViewPicker";

const PRESETS: { name: BakePreset; label: string; help: string }[] = [
  { name: "preview", label: "Draft", help: "for exploring looks" },
  { name: "good", label: "Standard", help: "for most work" },
  { name: "final", label: "Final", help: "for sharp highlights and print" },
];

/** Aspect ratio of a view in the scene's file. */
function aspectOf({ views }: SceneBody, name: string | undefined): number {
  return views.find((view) => view.name === name)?.aspect ?? DEFAULT_SIZE[0] / DEFAULT_SIZE[1];
}

type PresetPlans = Partial<Record<BakePreset, BakePlan>>;

const DEFAULT_SIZE: BakeSize = [640, 480];
const DEFAULT_NUM_LIGHTS = 2000;

function usePlans(
  scene: string,
  method: BakeMethod,
  views: readonly string[],
  relightable: boolean,
  aspect: number,
  waits: boolean,
): PresetPlans {
  const [plans, setPlans] = useState<PresetPlans>({});
  useEffect(() => {
    let stale = false;
    setPlans({});
    if (waits) return undefined;
    for (const { name } of PRESETS) {
      planBake({ scene, method, preset: name, aspect, views: [...views], relightable }).then(
        (plan) => !stale && setPlans((previous) => ({ ...previous, [name]: plan })),
        (error: unknown) => !stale && setPlans((current) => ({ ...current, [name]: error as Error })),
      );
    }
    return () => {
      stale = true;
    };
  }, [scene, method, views, relightable, aspect, waits]);
  return plans;
}

interface MethodPickerProps {
  selected: BakeMethod;
  onChoose: (method: BakeMethod) => void;
}

function MethodPicker({ selected, onChoose }: MethodPickerProps) {
  const group = useId();
  return (
    <fieldset class="bake-methods">
      <legend>Lighting</legend>
      {BAKE_METHODS.map(({ name, label, help }) => (
        <label key={name}>
          <input type="radio" name={group} checked={name === selected} onChange={() => onChoose(name)} />
          <b>{label}</b>
          <small>{help}</small>
        </label>
      ))}
    </fieldset>
  );
}

interface RelightableCheckboxProps {
  isRelightable: boolean;
  onChoose: (relightable: boolean) => void;
}

function RelightableCheckbox({ isRelightable, onChoose }: RelightableCheckboxProps) {
  return (
    <label class="bake-relightable">
      <input type="checkbox" checked={isRelightable} onChange={() => onChoose(!isRelightable)} />
      Optimize for swapping HDRIs
      <small>Bounce light and moving cameras follow another environment better, and this one slightly less well.</small>
    </label>
  );
}

interface PresetsProps {
  scene: SceneBody;
  /** Initial method. */
  method: BakeMethod;
  views: readonly string[];
  action: string;
  /** Initial custom size. */
  size?: BakeSize | null;
  /** Initial pose of a new camera; null: the scene's first camera. */
  from?: CameraPose | null;
  /** True while something else is more urgent for the server than the costs. */
  plansWait?: boolean;
  onChoose: (choice: BakeSettings) => void;
}

export function Presets({
  scene,
  method: initialMethod,
  views,
  action,
  size = null,
  from = null,
  plansWait = false,
  onChoose,
}: PresetsProps) {
  const [method, setMethod] = useState(initialMethod);
  const [selectedViews, setSelectedViews] = useState([...views]);
  const [relightable, setRelightable] = useState(false);
  const { shapes, selected: initialShape } = aspectChoicesFor(
    size === null ? aspectOf(scene, selectedViews[0]) : size[0] / size[1],
  );
  const [shape, setShape] = useState(initialShape);
  const { aspect } = shape;
  const plans = usePlans(scene.id, method, selectedViews, relightable, aspect, plansWait);
  return (
    <>
      <MethodPicker selected={method} onChoose={setMethod} />
      <ViewPicker scene={scene} from={from} selected={selectedViews} onChoose={setSelectedViews} />
      <div class="bake-shape">
        Aspect ratio
        <RadioRow
          label="Aspect ratio"
          choices={shapes.map(({ label }) => ({ value: label, label, title: `Aspect ratio ${label}` }))}
          selected={shape.label}
          onSelect={(label) => setShape(shapes.find((each) => each.label === label) ?? shape)}
        />
      </div>
      <RelightableCheckbox isRelightable={relightable} onChoose={setRelightable} />
      <ul class="presets">
        {PRESETS.map(({ name, label, help }) => (
          <li key={name}>
            <span class="preset-name">
              <b>{label}</b> {help}
            </span>
            <PlanText plan={plans[name]} />
            <button
              class={name === "good" ? "primary" : ""}
              disabled={plans[name] instanceof Error}
              onClick={() => onChoose({ method, preset: name, aspect, views: selectedViews, relightable })}
            >
              {action}
            </button>
          </li>
        ))}
        <CustomRecipe
          key={aspect}
          request={{ scene: scene.id, method, views: selectedViews, relightable }}
          initial={{
            size:
              shape.label === initialShape.label && size !== null ? size : resizeToAspect(size ?? DEFAULT_SIZE, aspect),
            lights: DEFAULT_NUM_LIGHTS,
          }}
          action={action}
          onChoose={(recipe) => onChoose({ method, views: selectedViews, relightable, ...recipe })}
        />
      </ul>
    </>
  );
}
