/** What can be baked: which light, which views, and the three presets with what each will cost, before anything starts. */
import { useEffect, useId, useState } from "preact/hooks";
import type { Frame } from "../cameras/orbit";
import { planBake } from "../net/api";
import type { SceneBody } from "../protocol";
import type { BakeChoice, Preset } from "../scene/bakeChoice";
import { METHODS, type Method } from "../scene/methods";
import { reshaped, shapesFor, type Size } from "../scene/recipe";
import { RadioRow } from "../ui/RadioRow";
import { OwnRecipe } from "./OwnRecipe";
import { PlanWords, type Planned } from "./PlanWords";
import { ViewChoice } from "./ViewChoice";

const PRESETS: { name: Preset; label: string; help: string }[] = [
  { name: "preview", label: "Preview", help: "to find the look" },
  { name: "good", label: "Good", help: "for most work" },
  { name: "final", label: "Final", help: "for sharp highlights and print" },
];

/** The shape of a view of the scene, as its file says. */
function aspectOf({ views }: SceneBody, name: string | undefined): number {
  return views.find((view) => view.name === name)?.aspect ?? OWN_SIZE[0] / OWN_SIZE[1];
}

type Plans = Partial<Record<Preset, Planned>>;

const OWN_SIZE: Size = [640, 480];
const OWN_LIGHTS = 2000;

function usePlans(scene: string, method: Method, views: readonly string[], relightable: boolean, aspect: number): Plans {
  const [plans, setPlans] = useState<Plans>({});
  useEffect(() => {
    let stale = false;
    setPlans({});
    for (const { name } of PRESETS) {
      planBake({ scene, method, preset: name, aspect, views: [...views], relightable }).then(
        (plan) => !stale && setPlans((before) => ({ ...before, [name]: plan })),
        (error: Error) => !stale && setPlans((before) => ({ ...before, [name]: error })),
      );
    }
    return () => {
      stale = true;
    };
  }, [scene, method, views, relightable, aspect]);
  return plans;
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

interface RelightableProps {
  chosen: boolean;
  onChoose(relightable: boolean): void;
}

function Relightable({ chosen, onChoose }: RelightableProps) {
  return (
    <label class="bake-relightable">
      <input type="checkbox" checked={chosen} onChange={() => onChoose(!chosen)} />
      Ready for other light
      <small>turning or exchanging the environment errs less; its own light is a little coarser</small>
    </label>
  );
}

interface Props {
  scene: SceneBody;
  /** What is chosen at first. */
  method: Method;
  views: readonly string[];
  action: string;
  /** Where a size of one's own begins. */
  size?: Size | null;
  /** Where a new camera begins; else where the scene's first one is. */
  from?: Frame | null;
  onChoose(choice: BakeChoice): void;
}

export function PresetList({ scene, method: initial, views, action, size = null, from = null, onChoose }: Props) {
  const [method, setMethod] = useState(initial);
  const [chosen, setChosen] = useState([...views]);
  const [relightable, setRelightable] = useState(false);
  const { shapes, chosen: initialShape } = shapesFor(size === null ? aspectOf(scene, chosen[0]) : size[0] / size[1]);
  const [shape, setShape] = useState(initialShape);
  const { aspect } = shape;
  const plans = usePlans(scene.id, method, chosen, relightable, aspect);
  return (
    <>
      <Methods chosen={method} onChoose={setMethod} />
      <ViewChoice scene={scene} from={from} chosen={chosen} onChoose={setChosen} />
      <div class="bake-shape">
        Shape of the picture
        <RadioRow
          label="Shape of the picture"
          choices={shapes.map(({ label }) => ({ value: label, label, title: `Width to height, ${label}` }))}
          chosen={shape.label}
          onChoose={(label) => setShape(shapes.find((each) => each.label === label) ?? shape)}
        />
      </div>
      <Relightable chosen={relightable} onChoose={setRelightable} />
      <ul class="presets">
        {PRESETS.map(({ name, label, help }) => (
          <li key={name}>
            <span class="preset-name">
              <b>{label}</b> {help}
            </span>
            <PlanWords plan={plans[name]} />
            <button
              class={name === "good" ? "primary" : ""}
              disabled={plans[name] instanceof Error}
              onClick={() => onChoose({ method, preset: name, aspect, views: chosen, relightable })}
            >
              {action}
            </button>
          </li>
        ))}
        <OwnRecipe
          key={aspect}
          request={{ scene: scene.id, method, views: chosen, relightable }}
          initial={{ size: shape.label === initialShape.label && size !== null ? size : reshaped(size ?? OWN_SIZE, aspect), lights: OWN_LIGHTS }}
          action={action}
          onChoose={(recipe) => onChoose({ method, views: chosen, relightable, ...recipe })}
        />
      </ul>
    </>
  );
}
