/** A bake of any size and shape, and any number of lights; its plan follows what is typed. */
import { useEffect, useState } from "preact/hooks";
import { planBake } from "../net/api";
import type { BakeRequest } from "../protocol";
import { GATHER_RAYS, GATHER_SAMPLES, LIGHTS, recipeProblem, SIDE, type OwnRecipe as Recipe } from "../scene/recipe";
import { PlanWords, type Planned } from "./PlanWords";

const TYPING_MS = 300;
/** What methods that gather light have besides. */
const GATHERING = [
  { name: "gather_samples", label: "Gather samples", range: GATHER_SAMPLES },
  { name: "gather_rays", label: "Rays a sample", range: GATHER_RAYS },
] as const;

/** The plan of what was typed last; undefined while it is asked for. */
function usePlan(request: BakeRequest, problem: string | null): Planned {
  const [plan, setPlan] = useState<Planned>(undefined);
  const asked = JSON.stringify(request);
  useEffect(() => {
    let stale = false;
    setPlan(problem === null ? undefined : new Error(problem));
    if (problem !== null) return undefined;
    const timer = setTimeout(() => {
      planBake(JSON.parse(asked) as BakeRequest).then(
        (found) => !stale && setPlan(found),
        (error: Error) => !stale && setPlan(error),
      );
    }, TYPING_MS);
    return () => {
      stale = true;
      clearTimeout(timer);
    };
  }, [asked, problem]);
  return plan;
}

interface FieldProps {
  label: string;
  /** Not a number: none is given. */
  value: number;
  placeholder?: string;
  range: { minimum: number; maximum: number };
  step: number;
  onChange(value: number): void;
}

function Field({ label, value, placeholder, range, step, onChange }: FieldProps) {
  return (
    <label>
      {label}
      <input
        type="number"
        class="number"
        min={range.minimum}
        max={range.maximum}
        step={step}
        placeholder={placeholder}
        value={Number.isFinite(value) ? value : ""}
        onKeyDown={(event) => event.key !== "Escape" && event.stopPropagation()}
        onInput={(event) => onChange(event.currentTarget.valueAsNumber)}
      />
    </label>
  );
}

interface Props {
  /** What is baked besides: scene, method, views. */
  request: BakeRequest;
  initial: Recipe;
  action: string;
  onChoose(recipe: Recipe): void;
}

export function OwnRecipe({ request, initial, action, onChoose }: Props) {
  const [typed, setRecipe] = useState(initial);
  const gathers = request.method === "gather" || request.method === "surface";
  const recipe: Recipe = gathers ? typed : { size: typed.size, lights: typed.lights };
  const setNumber = (name: "gather_samples" | "gather_rays", value: number) => {
    const { [name]: _, ...others } = recipe;
    setRecipe(Number.isNaN(value) ? others : { ...others, [name]: value });
  };
  const [width, height] = recipe.size;
  const plan = usePlan({ ...request, ...recipe }, recipeProblem(recipe));
  return (
    <li class="own-recipe">
      <span class="preset-name">
        <b>Your own</b> any shape: the view keeps its height, a wider picture shows more at its sides
      </span>
      <div class="recipe-fields" role="group" aria-label="Size and lights of your own bake">
        <Field label="Width" value={width} range={SIDE} step={1} onChange={(side) => setRecipe({ ...recipe, size: [side, height] })} />
        <Field label="Height" value={height} range={SIDE} step={1} onChange={(side) => setRecipe({ ...recipe, size: [width, side] })} />
        <Field label="Light triangles" value={recipe.lights} range={LIGHTS} step={1} onChange={(lights) => setRecipe({ ...recipe, lights })} />
        {gathers &&
          GATHERING.map(({ name, label, range }) => (
            <Field
              key={name}
              label={label}
              value={recipe[name] ?? NaN}
              placeholder="as fits"
              range={range}
              step={1}
              onChange={(value) => setNumber(name, value)}
            />
          ))}
      </div>
      <PlanWords plan={plan} />
      <button disabled={plan === undefined || plan instanceof Error} onClick={() => onChoose(recipe)}>
        {action}
      </button>
    </li>
  );
}
