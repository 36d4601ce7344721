/** The selected light: its kind, how strong it is, and where it is. */
import { ColorField } from "../inspector/ColorField";
import type { Light, Triple } from "../protocol";
import { edit } from "../state/edit";
import { hold } from "../state/live";
import { defaultLook } from "../state/store";
import { IconButton } from "../ui/Button";
import { NumberField } from "../ui/NumberField";
import { Slider } from "../ui/Slider";
import { KINDS, labelOf, UNITS, withKind, type AddedKind } from "./kinds";
import { editLight, isAdded, lightPath, removeLight } from "./lights";
import { length } from "./vector";

const FARTHEST = 1e6;

interface NumbersProps {
  label: string;
  unit: string;
  /** What each number is called. */
  names: readonly string[];
  values: readonly number[];
  minimum: number;
  maximum: number;
  step: number;
  onChange(values: number[]): void;
}

/** A few numbers on one line, each with its name. */
function Numbers({ label, unit, names, values, minimum, maximum, step, onChange }: NumbersProps) {
  return (
    <div class="numbers" role="group" aria-label={label} style={{ "--count": names.length }}>
      <span class="param-label">
        {label} {unit !== "" && <small>{unit}</small>}
      </span>
      {names.map((name, k) => (
        <label key={name}>
          <small>{name}</small>
          <NumberField
            label={`${label}, ${name}`}
            value={values[k] as number}
            minimum={minimum}
            maximum={maximum}
            step={step}
            onChange={(next) => onChange(values.map((value, i) => (i === k ? next : value)))}
          />
        </label>
      ))}
    </div>
  );
}

const XYZ = ["x", "y", "z"] as const;

function Place({ name, light }: { name: string; light: Light }) {
  const put = (deed: string, field: string) => (value: unknown) => editLight(deed, name, field, value);
  const range = { minimum: -FARTHEST, maximum: FARTHEST };
  const aim = (direction: number[]) => {
    if (length(direction as Triple) > 0) put("Aim", "direction")(direction);
  };
  return (
    <>
      {"position" in light && (
        <Numbers
          {...range}
          label="Position"
          unit="m"
          names={XYZ}
          values={light.position}
          step={0.01}
          onChange={put("Move", "position")}
        />
      )}
      {"direction" in light && (
        <Numbers
          {...range}
          label="Direction"
          unit=""
          names={XYZ}
          values={light.direction}
          step={0.05}
          onChange={aim}
        />
      )}
      {light.kind === "rectangle" && (
        <Numbers
          label="Size"
          unit="m"
          names={["width", "height"]}
          values={light.size}
          minimum={1e-4}
          maximum={1e4}
          step={0.01}
          onChange={put("Size", "size")}
        />
      )}
    </>
  );
}

interface AngleProps {
  label: string;
  value: number;
  initial: number;
  minimum: number;
  maximum: number;
  onChange(value: number): void;
  onHold(): void;
}

function Angle({ label, ...slider }: AngleProps) {
  return (
    <div class="param alone">
      <span class="param-label">{label}</span>
      <Slider label={label} scale="linear" unit="°" {...slider} />
    </div>
  );
}

function Angles({ name, light, initial }: { name: string; light: Light; initial: Light | undefined }) {
  const onHold = () => hold(lightPath(name));
  const put = (deed: string, field: string, value: unknown) => editLight(deed, name, field, value);
  if (light.kind === "rectangle") {
    return (
      <Angle
        label="Rotation"
        value={light.rotation}
        initial={initial?.kind === "rectangle" ? initial.rotation : 0}
        minimum={-180}
        maximum={180}
        onChange={(value) => put("Turn", "rotation", value)}
        onHold={onHold}
      />
    );
  }
  if (light.kind !== "spot") return null;
  const [inner, outer] = light.cone;
  const own = initial?.kind === "spot" ? initial.cone : undefined;
  return (
    <>
      <Angle
        label="Cone, full light"
        value={inner}
        initial={own?.[0] ?? 20}
        minimum={0}
        maximum={90}
        onChange={(value) => put("Cone", "cone", [value, Math.max(value, outer)])}
        onHold={onHold}
      />
      <Angle
        label="Cone, edge"
        value={outer}
        initial={own?.[1] ?? 30}
        minimum={1}
        maximum={90}
        onChange={(value) => put("Cone", "cone", [Math.min(inner, value), value])}
        onHold={onHold}
      />
    </>
  );
}

function Kind({ name, light }: { name: string; light: Light }) {
  if (light.kind === "mesh") return <p class="hint">The surfaces of “{light.material}” shine. Where they are is the scene’s own.</p>;
  return (
    <div class="kind">
      <select
        aria-label="Kind of light"
        value={light.kind}
        onChange={(event) =>
          edit("Change kind", lightPath(name), withKind(light, event.currentTarget.value as AddedKind))
        }
      >
        {KINDS.map(({ kind, label, help }) => (
          <option key={kind} value={kind} title={help}>
            {label}
          </option>
        ))}
      </select>
    </div>
  );
}

export function LightInspector({ name, light }: { name: string; light: Light }) {
  const initial = defaultLook.value?.lights[name];
  return (
    <aside class="panel inspector" aria-label="Inspector">
      <header class="panel-head">
        <h2 class="spacer">{name}</h2>
        {isAdded(name) ? (
          <IconButton icon="trash" label="Remove this light" keys="Delete" onClick={() => removeLight(name)} />
        ) : (
          <IconButton
            icon="reset"
            label="Reset this light"
            disabled={initial === light}
            onClick={() => edit("Reset", lightPath(name), initial)}
          />
        )}
      </header>
      <section class="card light-card" aria-label={labelOf(light.kind)}>
        <Kind name={name} light={light} />
        <span class="param-label">
          Emission <small>{UNITS[light.kind]}</small>
        </span>
        <ColorField
          label="Emission"
          quantity
          value={light.emission}
          initial={initial?.emission ?? null}
          onChange={(value) => editLight("Emission", name, "emission", value)}
        />
        <Place name={name} light={light} />
        <Angles name={name} light={light} initial={initial} />
      </section>
    </aside>
  );
}
