/** A bake of any size and shape, and any number of lights; its plan follows what is typed. */
import { useEffect, useState } from "preact/hooks";
import { planBake } from "../session/net/api";
import type { BakeRequest } from "../protocol";
import { GATHER_RAYS_RANGE, PATCHES_RANGE, LIGHTS_RANGE, validateRecipe, SIDE_RANGE, type CustomBakeRecipe as Recipe } from "../session/scene/recipe";
import { PlanText, type BakePlan } from "./PlanText";

const TYPING_DELAY_MS = 300;
/** What methods that gather light have besides. */
const GATHER_FIELDS = [
  { name: "patches", label: "Patches", range: PATCHES_RANGE },
  { name: "gather_rays", label: "Rays a sample", range: GATHER_RAYS_RANGE },
] as const;

/** The plan of what was typed last; undefined while it is asked for. */
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
        (error: Error) => !stale && setPlan(error),
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
  /** Not a number: none is given. */
  value: number;
  placeholder?: string;
  range: { minimum: number; maximum: number };
  step: number;
  onChange(value: number): void;
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
  /** What is baked besides: scene, method, views. */
  request: BakeRequest;
  initial: Recipe;
  action: string;
  onChoose(recipe: Recipe): void;
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
    <li class="own-recipe">
      <span class="preset-name">
        <b>Your own</b> any shape: the view keeps its height, a wider picture shows more at its sides
      </span>
      <div class="recipe-fields" role="group" aria-label="Size and lights of your own bake">
        <RecipeField label="Width" value={width} range={SIDE_RANGE} step={1} onChange={(side) => setRecipe({ ...recipe, size: [side, height] })} />
        <RecipeField label="Height" value={height} range={SIDE_RANGE} step={1} onChange={(side) => setRecipe({ ...recipe, size: [width, side] })} />
        <RecipeField label="Light triangles" value={recipe.lights} range={LIGHTS_RANGE} step={1} onChange={(lights) => setRecipe({ ...recipe, lights })} />
        {gathers &&
          GATHER_FIELDS.map(({ name, label, range }) => (
            <RecipeField
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
      <PlanText plan={plan} />
      <button disabled={plan === undefined || plan instanceof Error} onClick={() => onChoose(recipe)}>
        {action}
      </button>
    </li>
  );
}
