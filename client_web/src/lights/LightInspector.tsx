/** The selected light: its kind, how strong it is, and where it is. */
import { edit } from "../edit/edit";
import { hold } from "../live/touch";
import { MAX_LIGHT_NAME } from "../look.gen";
import type { Light, Triple } from "../protocol";
import { defaultLook } from "../state/look";
import { aimLocked } from "../state/panels";
import { IconButton } from "../ui/Button";
import { EditableName } from "../ui/EditableName";
import { LabelledSlider } from "../ui/LabelledSlider";
import { NumberField } from "../ui/NumberField";
import { Emission } from "./Emission";
import { anglesOf, numbersOf, type AngleField, type NumbersField } from "./fields";
import { placed } from "./handleGeometry";
import { completedLight, KINDS, labelOf, withKind, type AddedKind } from "./kinds";
import { changeLight, duplicateLight, editLight, isAdded, lightPath, removeLight, renameLight } from "./lights";

interface Shown {
  name: string;
  light: Light;
}

function Numbers({ name, light, of }: Shown & { of: NumbersField }) {
  const { field, label, unit } = of;
  const values = (light as Partial<Record<NumbersField["field"], number[]>>)[field] ?? [];
  const put = (next: number[]) => {
    if (field === "position") {
      const change = placed(light, next as Triple, aimLocked.value);
      if (change !== null) changeLight(of.deed, name, change);
    } else if (of.allows?.(next) ?? true) editLight(of.deed, name, field, next);
  };
  return (
    <div class="numbers" role="group" aria-label={label} style={{ "--count": of.names.length }}>
      <span class="param-label">
        {label} {unit !== "" && <small>{unit}</small>}
      </span>
      {of.names.map((each, k) => (
        <label key={each}>
          <small>{each}</small>
          <NumberField
            label={`${label}, ${each}`}
            value={values[k] as number}
            minimum={of.minimum}
            maximum={of.maximum}
            step={of.step}
            onChange={(next) => put(values.map((value, i) => (i === k ? next : value)))}
          />
        </label>
      ))}
    </div>
  );
}

function Angle({ name, light, of }: Shown & { of: AngleField }) {
  return (
    <LabelledSlider
      label={of.label}
      value={of.read(light)}
      initial={of.read(completedLight({ kind: light.kind }, defaultLook.value?.lights[name]))}
      minimum={of.minimum}
      maximum={of.maximum}
      scale="linear"
      unit="°"
      onChange={(angle) => editLight(of.deed, name, of.field, of.changed(light, angle))}
      onHold={() => hold(lightPath(name))}
    />
  );
}

function Kind({ name, light }: Shown) {
  if (light.kind === "mesh")
    return <p class="hint">The surfaces of “{light.material}” shine. Where they are is the scene’s own.</p>;
  const change = (kind: AddedKind) => edit("Change kind", lightPath(name), withKind(light, kind));
  return (
    <div class="kind">
      <select
        aria-label="Kind of light"
        value={light.kind}
        onChange={(event) => change(event.currentTarget.value as AddedKind)}
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

function AimLock() {
  return (
    <label class="aim-lock" title="While it is moved, it goes on aiming at the same point">
      <input
        type="checkbox"
        checked={aimLocked.value}
        onChange={(event) => (aimLocked.value = event.currentTarget.checked)}
      />
      Keep the aim when it moves
    </label>
  );
}

export function LightInspector({ name, light }: Shown) {
  const initial = defaultLook.value?.lights[name];
  return (
    <div class="panel inspector">
      <header class="panel-head">
        <h2 class="spacer">
          {isAdded(name) ? (
            <EditableName
              key={name}
              class="light-name"
              name={name}
              maximum={MAX_LIGHT_NAME}
              onRename={(next) => renameLight(name, next)}
            />
          ) : (
            name
          )}
        </h2>
        {light.kind !== "mesh" && (
          <IconButton icon="copy" label="Duplicate this light" onClick={() => duplicateLight(name)} />
        )}
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
        <Emission name={name} light={light} />
        {"position" in light && "direction" in light && <AimLock />}
        {numbersOf(light).map((of) => (
          <Numbers key={of.label} name={name} light={light} of={of} />
        ))}
        {anglesOf(light).map((of) => (
          <Angle key={of.label} name={name} light={light} of={of} />
        ))}
      </section>
    </div>
  );
}
