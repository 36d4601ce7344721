/** A custom bake: size, number of lights, sampling. The estimate updates while typing. */
import { useEffect, useState } from "preact/hooks";
import { planBake } from "../session/net/api";
import type { BakeRequest } from "../protocol";
import { GATHER_RAYS_RANGE, PATCHES_RANGE, LIGHTS_RANGE, validateRecipe, SIDE_RANGE, type CustomBakeRecipe as Recipe } from "../session/scene/recipe";
import { PlanText, type BakePlan } from "./PlanText";

const TYPING_DELAY_MS = 300;
/** Additional fields of methods with indirect light. */
const GATHER_FIELDS = [
  { name: "patches", label: "Bounce samples", range: PATCHES_RANGE },
  { name: "gather_rays", label: "Rays per sample", range: GATHER_RAYS_RANGE },
] as const;

/** Estimate for the current input; undefined while loading. */
function usePlan(request: BakeRequest, problem: string | null): BakePlan {
  const [plan, setPlan] = useState<BakePlan>(undefined);
  const requestText = JSON.stringify(request);
  useEffect(() => {
    let stale = false;
    setPlan(problem === null ? undefined : new Error(problem));
    if (problem !== null) return undefined;
    const timer = setTimeout(() => {
      planBake(JSON.parse(requestText) as BakeRequest).then(
        (dryRun) => !stale && setPlan(dryRun),
        (error: unknown) => !stale && setPlan(error as Error),
      );
    }, TYPING_DELAY_MS);
    return () => {
      stale = true;
      clearTimeout(timer);
    };
  }, [requestText, problem]);
  return plan;
}

interface RecipeFieldProps {
  label: string;
  /** NaN: unset. */
  value: number;
  placeholder?: string;
  range: { minimum: number; maximum: number };
  step: number;
  onChange: (value: number) => void;
}

function RecipeField({ label, value, placeholder, range, step, onChange }: RecipeFieldProps) {
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

interface CustomRecipeProps {
  /** The other settings: scene, method, views. */
  request: BakeRequest;
  initial: Recipe;
  action: string;
  onChoose: (recipe: Recipe) => void;
}

export function CustomRecipe({ request, initial, action, onChoose }: CustomRecipeProps) {
  const [typed, setRecipe] = useState(initial);
  const gathers = request.method === "gather" || request.method === "probes";
  const recipe: Recipe = gathers ? typed : { size: typed.size, lights: typed.lights };
  const setNumber = (name: "patches" | "gather_rays", value: number) => {
    const { [name]: _, ...remaining } = recipe;
    setRecipe(Number.isNaN(value) ? remaining : { ...remaining, [name]: value });
  };
  const [width, height] = recipe.size;
  const plan = usePlan({ ...request, ...recipe }, validateRecipe(recipe));
  return (
    <li class="custom-recipe">
      <span class="preset-name">
        <b>Custom</b> a wider frame shows more at the sides
      </span>
      <div class="recipe-fields" role="group" aria-label="Custom bake">
        <RecipeField label="Width" value={width} range={SIDE_RANGE} step={1} onChange={(side) => setRecipe({ ...recipe, size: [side, height] })} />
        <RecipeField label="Height" value={height} range={SIDE_RANGE} step={1} onChange={(side) => setRecipe({ ...recipe, size: [width, side] })} />
        <RecipeField label="Environment detail" value={recipe.lights} range={LIGHTS_RANGE} step={1} onChange={(lights) => setRecipe({ ...recipe, lights })} />
        {gathers &&
          GATHER_FIELDS.map(({ name, label, range }) => (
            <RecipeField
              key={name}
              label={label}
              value={recipe[name] ?? NaN}
              placeholder="auto"
              range={range}
              step={1}
              onChange={(value) => setNumber(name, value)}
            />
          ))}
      </div>
      <PlanText plan={plan} />
      <button disabled={plan === undefined || plan instanceof Error} onClick={() => onChoose(recipe)}>
        {action}
      </button>
    </li>
  );
}
